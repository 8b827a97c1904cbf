//! The layout of a file: from its index, or by walking all of it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::layout::Layout;
use super::{index, scan};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;

impl Layout {
    /// Reads the index of the file, or the whole file if it has none that is sound.
    ///
    /// # Errors
    /// If it cannot be opened, or not even its first record can be read.
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
        // A file that is torn within its data cannot have an index, so that is not reported.
        let torn = |damage: &Damage| damage.kind == DamageKind::TornTail;
        if layout.damage.iter().any(torn) {
            layout
                .damage
                .retain(|damage| !matches!(damage.kind, DamageKind::Index { .. }));
        }
        layout.checked()
    }

    /// A layout of which at least the first record could be read.
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
        reason: "it does not begin as an MCAP file does".to_owned(),
    })
}
