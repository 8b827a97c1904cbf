//! Results of replays at scale: one recording gives one Parquet file, named by the hash of all that it depends on.
//!
//! So the same work gives the same name and the same bytes, whoever does it and how often. A file that is there is
//! whole, what is there need not be done again, and runners that meet do no harm.

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
