//! Monitoring of all cells: their status with its age, their incidents, a page and metrics.

#[cfg(test)]
mod fixture;
pub mod hub;
pub mod inbox;
mod keeper;
mod mailbox;
pub mod physics;
pub mod show;
pub mod store;
pub mod wall;
pub mod web;
mod words;

pub use hub::{FleetError, Hub, Options};
