//! `tauscope init`: from contact-free recordings to a folder with a running pipeline.
//!
//! 0. [`live`]: with `--live`, the recordings are made first.
//! 1. [`look`]: the recordings are read as by `explain`, and some are held out.
//! 2. `explain` makes the twin.
//! 3. [`learn`]: the detector is trained behind this twin, and tested on the held-out recordings.
//! 4. [`folder`]: the files are written.

mod folder;
mod learn;
mod live;
mod look;
mod page;

use std::path::Path;

use tauscope_archive::whole_file::{self, Existing};
use tauscope_pipeline::report::Problem;

use crate::exit::Failure;

pub use folder::Folder;
pub use learn::learn;
pub use live::Live;
pub use look::{Looked, Told};
pub use page::{Seen, page};

/// Writes a file of the folder, whole or not at all. Existing files were checked before the work began.
pub fn write(path: &Path, content: &[u8]) -> Result<(), Failure> {
    whole_file::write(path, content, Existing::Replace).map_err(|error| {
        Failure::Rejected(Problem::of_file(path, format!("cannot write: {error}")).into())
    })
}
