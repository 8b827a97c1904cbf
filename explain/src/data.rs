//! Step 2, prepare: smoothed motion, filtered effort, and the rows that are compared.
//!
//! In: the recordings of step 1. Out: a [`problem::Problem`], the data of a regression. Position, velocity and
//! acceleration come from a quintic smoothing spline (de Boor, *A Practical Guide to Splines*, revised edition 2001,
//! chapter XIV). Measured effort and every regressor column pass through one zero-phase low-pass (Eilers, "A Perfect
//! Smoother", *Analytical Chemistry* 75, 2003), so that filtering biases no parameter; identification of robots calls
//! this the parallel filter (Khalil and Dombre, *Modeling, Identification and Control of Robots*, 2002, chapter 12).
//! Rows are thinned to twice the cutoff, standstills and gaps are masked, and the variance of the white noise is
//! measured from fourth differences.

pub mod column;
mod compared;
pub mod efforts;
pub mod memo;
pub mod noise;
pub mod other_simulation;
pub mod prepare;
pub mod problem;
pub mod quiet_start;
pub mod remedies;
pub mod same_robot;
pub mod smoother;
pub mod standstill;
pub mod track;
pub mod units;
