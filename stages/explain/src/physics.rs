//! Step 3, predict: the effort that a set of physical effects adds to what the twin computes.

pub mod active;
pub mod bodies;
pub mod columns;
pub mod efforts;
pub mod friction;
pub mod library;
pub mod parts;
pub mod start;
pub mod torque_scale;
