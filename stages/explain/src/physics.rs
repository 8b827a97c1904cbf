//! Step 3, predict: the effort that a set of physical effects adds to what the twin computes.

pub mod act;
pub mod active;
pub mod bodies;
pub mod columns;
pub mod efforts;
pub mod friction;
pub mod kinematic_tree;
pub mod library;
pub mod parameter_units;
pub mod parts;
pub mod shaped_bodies;
pub mod start;
pub mod torque_scale;
pub mod unit_columns;
