//! Layout of an MCAP file, read from its index, or by scanning the whole file.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::layout::Layout;
use super::{index, scan};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;

impl Layout {
    /// Reads the layout from the index at the end of the file, or by scanning the file if it has no sound index.
    ///
    /// # Errors
    /// If the file cannot be opened, or is unreadable from its first record on.
    pub(crate) fn read(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(ArchiveError::io(path))?;
        let file_bytes = file.metadata().map_err(ArchiveError::io(path))?.len();
        check_magic(&file, path)?;
        let mut layout = Self::empty(path, file_bytes);
        match index::read(&file, &mut layout).map_err(ArchiveError::io(path))? {
            index::Outcome::Complete => return layout.checked(),
            index::Outcome::Absent => layout = Self::empty(path, file_bytes),
            index::Outcome::Unsound { at, reason } => {
                layout = Self::empty(path, file_bytes);
                layout.damage(at, DamageKind::Index { reason });
            }
        }
        scan::read(&file, &mut layout).map_err(ArchiveError::io(path))?;
        // A truncated file has lost the index at its end as well, so only the truncation is reported.
        let torn = |damage: &Damage| damage.kind == DamageKind::TornTail;
        if layout.damage.iter().any(torn) {
            layout
                .damage
                .retain(|damage| !matches!(damage.kind, DamageKind::Index { .. }));
        }
        layout.checked()
    }

    /// Returns the layout, or an error if the header, which is the first record, could not be read.
    fn checked(self) -> Result<Self, ArchiveError> {
        if self.header_read {
            return Ok(self);
        }
        let reason = self.damage.first().map(|damage| damage.kind.to_string());
        Err(ArchiveError::Unreadable {
            reason: reason.unwrap_or_else(|| "it has no header".to_owned()),
            path: self.path,
        })
    }
}

fn check_magic(file: &File, path: &Path) -> Result<(), ArchiveError> {
    let mut magic = Vec::new();
    file.take(mcap::MAGIC.len() as u64)
        .read_to_end(&mut magic)
        .map_err(ArchiveError::io(path))?;
    if magic == mcap::MAGIC {
        return Ok(());
    }
    Err(ArchiveError::Unreadable {
        path: path.to_owned(),
        reason: "it does not begin with the magic of MCAP".to_owned(),
    })
}
