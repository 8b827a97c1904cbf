//! Step 2, prepare: smoothed motion, filtered effort, and the rows that are compared.

pub mod column;
pub mod effective_samples;
pub mod efforts;
pub mod memo;
pub mod noise;
pub mod prepare;
pub mod problem;
pub mod same_robot;
pub mod smoother;
pub mod standstill;
pub mod track;
pub mod units;
