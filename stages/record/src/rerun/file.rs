//! The picture in a file.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use rerun::external::re_build_info::CrateVersion;
use rerun::external::re_log_encoding::{Encoder, EncodingOptions};
use rerun::log::LogMsg;

use crate::error::RecordError;

/// An `.rrd` file, with `.part` at the end of its name until it is whole.
pub(super) struct PictureFile {
    path: PathBuf,
    part: PathBuf,
    encoder: Encoder<BufWriter<File>>,
}

impl PictureFile {
    /// Makes the file, and its folder where there is none.
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        let mut part = path.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let failed = |error: &dyn std::fmt::Display| RecordError::RerunFile {
            path: part.clone(),
            reason: error.to_string(),
        };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|error| failed(&error))?;
        }
        let file = File::create(&part).map_err(|error| failed(&error))?;
        let encoder = Encoder::new_eager(
            CrateVersion::LOCAL,
            EncodingOptions::PROTOBUF_COMPRESSED,
            BufWriter::new(file),
        )
        .map_err(|error| failed(&error))?;
        Ok(Self {
            path: path.to_owned(),
            part,
            encoder,
        })
    }

    pub fn write(&mut self, message: &LogMsg) -> Result<(), RecordError> {
        match self.encoder.append(message) {
            Ok(_) => Ok(()),
            Err(error) => Err(self.failed(&error)),
        }
    }

    /// Completes it and gives it its name.
    pub fn finish(&mut self) -> Result<(), RecordError> {
        self.encoder.finish().map_err(|error| self.failed(&error))?;
        self.encoder
            .flush_blocking()
            .map_err(|error| self.failed(&error))?;
        std::fs::rename(&self.part, &self.path).map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &dyn std::fmt::Display) -> RecordError {
        RecordError::RerunFile {
            path: self.part.clone(),
            reason: error.to_string(),
        }
    }
}
