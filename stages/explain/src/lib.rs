//! Why a twin and a recording differ: locate the mismatch, name the physics that was left out, model it and prove it
//! on recordings that were never fitted.

pub mod active;
pub mod fit;
pub mod least_squares;
pub mod library;
pub mod problem;
pub mod propose;
pub mod recording;
pub mod report;
pub mod search;
pub mod smoother;
mod unknown;
mod wall;
pub mod windows;
