//! Detectors trained, thresholded and scored on labelled recordings.

mod bad_readings;
mod error;
mod evaluation;
mod files;
mod heard;
mod html;
mod input;
mod judged;
mod labels;
mod metrics;
mod parquet;
mod recording;
mod registry;
mod runner;
mod session;
mod tables;
mod twin;

pub use error::EvaluateError;
pub use evaluation::{Evaluation, Progress, Run, run};
pub use files::{WriteError, prepare, write};
pub use input::{Options, Request, load};
pub use judged::Judged;
pub use metrics::Numbers;
pub use tables::{Table, all as tables, text};
