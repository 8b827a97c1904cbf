//! Step 2, prepare: smoothed motion, filtered effort, and the rows that are compared.

pub mod effective_samples;
pub mod problem;
pub mod smoother;
pub mod standstill;
pub mod track;
