//! The commands, one module each: arguments and implementation.

pub mod calibrate;
pub mod check;
pub mod cluster;
pub mod completions;
pub mod diff;
pub mod doctor;
pub mod evaluate;
pub mod explain;
pub mod export;
pub mod fleet;
pub mod info;
pub mod init;
pub mod man;
pub mod manifest;
pub mod physics;
pub mod query;
pub mod repair;
pub mod replay;
pub mod run;
pub mod schema;
pub mod send;
pub mod simulate;
pub mod stage;
pub mod weeks;

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use tauscope_bus::EffortUnit;

/// Returns a parser for the unit of the effort.
fn effort_unit() -> impl TypedValueParser<Value = EffortUnit> {
    let names = EffortUnit::ALL.map(EffortUnit::as_str);
    PossibleValuesParser::new(names).try_map(|text| text.parse::<EffortUnit>())
}

/// Returns the pipeline file, named as an argument or with `--pipeline`; by default `pipeline.yaml`.
fn pipeline_file<'a>(argument: Option<&'a PathBuf>, option: Option<&'a PathBuf>) -> &'a Path {
    let named = argument.or(option).map(PathBuf::as_path);
    named.unwrap_or(Path::new("pipeline.yaml"))
}
