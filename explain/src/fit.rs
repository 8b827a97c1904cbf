//! Step 4, fit: a set of effects with its numbers.
//!
//! In: the data of step 2 and a list of effects with numbers. Out: a [`fitted::Fit`], the residual that they leave at each
//! joint, and how it changes with each number. `inference` refines the numbers.

pub mod consistent_bodies;
pub mod fitted;
pub mod interval;
pub mod jacobian;
pub mod least_squares;
