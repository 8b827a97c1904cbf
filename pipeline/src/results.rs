//! Results of replays at scale: one Parquet file per recording, named by the hash of all its inputs.
//!
//! The same inputs therefore give the same name and the same bytes on every runner. An existing file is complete and
//! need not be computed again, and concurrent runners do not interfere.

mod compare;
mod identity;
mod manifest;
mod read;
mod rows;
mod shelf;
mod unit;

pub use compare::{Ambiguous, Change, Comparison, Counts, Difference, Told, compare};
pub use identity::Identity;
pub use manifest::{Manifest, Wanted};
pub use read::{EventRow, ReadError, RecordingRow, Results, parquet_files, read_results};
pub use rows::{COLUMNS, Row, RowWriter, schema};
pub use shelf::{Folder, Shelf};
pub use unit::{Done, Unit, UnitError};
