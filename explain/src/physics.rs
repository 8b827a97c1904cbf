//! Step 3, predict: the effort that a set of physical effects adds to what the rigid-body twin computes.
//!
//! In: the motion of step 2 and a list of effects with their coordinates. Out: efforts over all recordings, layer by
//! layer (bodies, joint friction, what the sensor records), and columns: how the recorded effort changes per unit of
//! each factor. Effort is linear in the factors, which include the ten inertial parameters of each body (Khalil and
//! Dombre, *Modeling, Identification and Control of Robots*, 2002, chapter 9); so the effort of an explanation is a sum
//! of parts, each of them filtered once. The effects themselves are in `tauscope_dynamics::terms`.

pub mod act;
pub mod active;
pub mod bodies;
pub mod carrier;
pub mod columns;
pub mod efforts;
pub mod friction;
pub mod library;
pub mod parameter_units;
pub mod parts;
pub mod shaped_bodies;
pub mod start;
pub mod torque_scale;
pub mod unit_columns;
pub mod whereabouts;
