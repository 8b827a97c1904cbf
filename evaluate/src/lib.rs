#![doc = include_str!("../README.md")]

mod bad_readings;
mod error;
mod evaluation;
mod files;
mod html;
mod input;
mod judged;
mod labels;
mod metrics;
mod notes;
mod parquet;
mod recording;
mod registry;
mod runner;
mod session;
mod tables;
mod twin;

pub use error::EvaluateError;
pub use evaluation::{Evaluation, Progress, Run, run};
pub use files::{WriteError, prepare, results, write};
pub use input::{Options, Request, load};
pub use judged::Judged;
pub use metrics::Numbers;
pub use recording::Role;
pub use runner::Output;
pub use tables::{Table, all as tables, text};
