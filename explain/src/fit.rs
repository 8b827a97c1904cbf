//! Step 4, fit: evaluation of a set of effects at given parameters.
//!
//! In: the data of step 2 and a list of effects with parameters. Out: a [`fitted::Fit`] with the residual of each
//! joint, and its Jacobian with respect to the parameters. `inference` refines the parameters.

pub mod consistent_bodies;
pub mod fitted;
pub mod interval;
pub mod jacobian;
pub mod least_squares;
