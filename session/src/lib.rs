#![doc = include_str!("../README.md")]

mod assembler;
mod clock;
mod error;
mod finding;
mod look;
mod plausible;
mod publisher;
pub mod robot;
mod selection;
pub mod suggest;
mod survey;
mod values;

use std::path::Path;

use tauscope_archive::{ArchiveError, CsvMapping, Recording};

pub use assembler::{Assembler, Counts, Gather, Layout, Layouts, Taken, Whole, stamp_of};
pub use clock::Clock;
pub use error::{SessionError, Unusable, by_reason};
pub use finding::{Effect, Finding, OddVelocity, Times, by_recording};
pub use look::{Joints, Look};
pub use plausible::Plausible;
pub use publisher::Publisher;
pub use survey::Survey;
pub use values::Ranges;

/// Opens the recording at `path`, whatever its format.
///
/// # Errors
/// If there is no recording, or it cannot be read from its first record.
pub fn open(path: &Path) -> Result<Recording, ArchiveError> {
    Recording::open(path)
}

/// Opens the table at `path` with the columns that `mapping` gives; `joints` are the names that its columns stand for
/// unless the mapping has its own.
///
/// # Errors
/// If there is no table, the mapping does not fit it, or a row is broken.
pub fn open_table(
    path: &Path,
    mapping: &CsvMapping,
    joints: &[String],
) -> Result<Recording, ArchiveError> {
    Recording::open_csv(path, mapping, joints)
}
