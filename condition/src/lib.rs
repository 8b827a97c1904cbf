#![doc = include_str!("../README.md")]

pub mod cell;
pub mod cusum;
mod finding;
pub mod forecast;
pub mod peers;
mod reference;
pub mod robust;
pub mod series;
pub mod shape;
pub mod short;
pub mod watch;
mod words;

pub use cell::assess;
pub use finding::{Cause, Finding};
pub use forecast::Forecast;
pub use series::{Covariate, Estimate, Quantity, Series, Warmth};
