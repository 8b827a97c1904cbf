//! Step 4, fit: the numbers of a set of effects by least squares, and how well they are known.

pub mod body_prior;
pub mod body_step;
pub mod fitted;
pub mod interval;
pub mod jacobian;
pub mod least_squares;
pub mod refine;
pub mod urdf_uncertainty;
