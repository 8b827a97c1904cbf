//! Step 4, fit: the numbers of a set of effects, and how well they are known.
//!
//! In: the data of step 2 and a list of effects. Out: a [`fitted::Fit`] with the maximum-likelihood numbers, what it
//! leaves at each joint, and the covariance of the numbers. Weighted least squares over all joints (Swevers, Verdonck
//! and De Schutter, "Dynamic Model Identification for Industrial Robots", *IEEE Control Systems Magazine* 27(5), 2007)
//! with Gauss-Newton steps and Levenberg's damping (Nocedal and Wright, *Numerical Optimization*, 2006, section 10.3).
//! Bodies stay physically consistent through a smooth prior over their pseudo-inertia (Wensing, Kim and Slotine, 2018;
//! Lee, Wensing and Park, 2020; see `body_prior.rs`). Intervals come from the sandwich covariance (White, "A
//! Heteroskedasticity-Consistent Covariance Matrix Estimator", *Econometrica* 48, 1980; see `covariance.rs`).

pub mod body_prior;
pub mod body_step;
pub mod covariance;
pub mod cross_validation;
mod disagreement;
pub mod fitted;
pub mod interval;
pub mod jacobian;
pub mod least_squares;
pub mod refine;
