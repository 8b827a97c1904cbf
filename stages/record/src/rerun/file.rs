//! The picture in a file.

use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use rerun::external::re_build_info::CrateVersion;
use rerun::external::re_log_encoding::{Encoder, EncodingOptions};
use rerun::log::LogMsg;

use tauscope_archive::whole_file::{self, Existing, part_of};

use crate::error::{RecordError, says_full};

/// An `.rrd` file, whose name ends with `.part` until it is complete.
pub(super) struct PictureFile {
    path: PathBuf,
    part: PathBuf,
    existing: Existing,
    encoder: Encoder<BufWriter<File>>,
    /// Second handle of the file, for syncing.
    file: File,
}

pub(super) type Cause = dyn std::error::Error + 'static;

pub(super) fn failed(part: &Path, error: &Cause) -> RecordError {
    RecordError::RerunFile {
        path: part.to_owned(),
        reason: error.to_string(),
        full: says_full(error),
    }
}

impl PictureFile {
    /// Creates the file, and its folder if missing. `existing` is the policy for a file that already has the name
    /// when this one is complete.
    pub fn create(path: &Path, existing: Existing) -> Result<Self, RecordError> {
        let part = part_of(path);
        let failed = |error: &Cause| failed(&part, error);
        if let Some(folder) = path.parent() {
            whole_file::create_folder(folder).map_err(|error| failed(&error))?;
        }
        whole_file::set_part_aside(path).map_err(|error| failed(&error))?;
        let new = OpenOptions::new().write(true).create_new(true).clone();
        Self::begin(path, part, existing, &new)
    }

    /// Creates the unfinished file `part`, which becomes `path`.
    pub fn begin(
        path: &Path,
        part: PathBuf,
        existing: Existing,
        options: &OpenOptions,
    ) -> Result<Self, RecordError> {
        let failed = |error: &Cause| failed(&part, error);
        let file = whole_file::create(&part, options).map_err(|error| failed(&error))?;
        whole_file::hold(&file).map_err(|error| failed(&error))?;
        whole_file::sync_folder_of(&part).map_err(|error| failed(&error))?;
        let twin = file.try_clone().map_err(|error| failed(&error))?;
        let encoder = Encoder::new_eager(
            CrateVersion::LOCAL,
            EncodingOptions::PROTOBUF_COMPRESSED,
            BufWriter::new(file),
        )
        .map_err(|error| failed(&error))?;
        Ok(Self {
            path: path.to_owned(),
            part,
            existing,
            encoder,
            file: twin,
        })
    }

    pub fn write(&mut self, message: &LogMsg) -> Result<(), RecordError> {
        match self.encoder.append(message) {
            Ok(_) => Ok(()),
            Err(error) => Err(self.failed(&error)),
        }
    }

    /// Completes and renames the file; returns its path. If an existing file with that name must be kept, the path is
    /// the next unused name.
    pub fn finish(mut self) -> Result<PathBuf, RecordError> {
        self.encoder.finish().map_err(|error| self.failed(&error))?;
        self.encoder
            .flush_blocking()
            .map_err(|error| self.failed(&error))?;
        self.file.sync_all().map_err(|error| self.failed(&error))?;
        let path = match self.existing {
            Existing::Replace => Ok(self.path.clone()),
            Existing::Keep => whole_file::unused_name(&self.path),
        };
        let path = path.map_err(|error| self.failed(&error))?;
        whole_file::put_in_place(&self.part, &path, self.existing)
            .map_err(|error| self.failed(&error))?;
        Ok(path)
    }

    fn failed(&self, error: &Cause) -> RecordError {
        failed(&self.part, error)
    }
}
