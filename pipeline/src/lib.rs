#![doc = include_str!("../README.md")]
#![cfg_attr(
    test,
    allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")
)]

pub mod announce;
pub mod build;
pub mod calibrate;
pub mod cell;
pub mod files;
pub mod learnt_state;
pub mod parallel;
pub mod pipeline;
pub mod plausible;
pub mod provenance;
pub mod recordings;
pub mod replay;
pub mod report;
pub mod results;
pub mod scenario;
pub mod tables;
pub mod tally;
pub mod trained;
pub mod yaml;

pub use tauscope_session::{robot as urdf, suggest};
