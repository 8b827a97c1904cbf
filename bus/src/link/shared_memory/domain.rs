//! Domains: the names that isolate the runs on a host from each other.

use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};
use std::{fs, io};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path, SemanticString};
use serde::{Deserialize, Serialize};

use super::open_error;
use crate::link::LinkError;

/// Directory of named shared memory on Linux.
pub(super) const SEGMENTS: &str = "/dev/shm";

/// The name by which the processes of one run find each other on a host, and which isolates them from other runs:
/// 1 to 16 of `a-z`, `0-9` and `_`.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Domain(String);

/// A text that is not a valid [`Domain`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no domain: 1 to {max} of a-z, 0-9 and _", max = Domain::CAPACITY)]
pub struct DomainError(String);

impl Domain {
    /// Longest name \[bytes\]: the paths of sockets below it must be shorter than 104 bytes.
    /// Physical: `sockaddr_un` of Linux holds a path of 108 bytes, that of macOS 104.
    pub const CAPACITY: usize = 16;

    /// Prefix of a domain's folder in `/tmp`.
    pub(super) const FOLDER: &str = "tauscope_";

    /// The domain of that name.
    ///
    /// # Errors
    /// If the name is empty, too long or has other characters.
    pub fn new(name: &str) -> Result<Self, DomainError> {
        let fits = (1..=Self::CAPACITY).contains(&name.len());
        let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
        if fits && name.bytes().all(plain) {
            Ok(Self(name.to_owned()))
        } else {
            Err(DomainError(name.to_owned()))
        }
    }

    /// A domain that no other process has created, named after the process id and the time.
    pub fn unique() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let nanoseconds = now.map_or(0, |elapsed| elapsed.as_nanos()) as u32;
        // Two domains of one process differ in the time only, hence the nanoseconds.
        Self(format!("t{:07x}{nanoseconds:08x}", std::process::id()))
    }

    /// Whether the name has the form of those from [`Domain::unique`].
    pub(super) fn is_unique_name(name: &str) -> bool {
        let digits = name.strip_prefix('t').unwrap_or_default();
        digits.len() == 15 && digits.bytes().all(|b| b.is_ascii_hexdigit())
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Directory of the domain's files, except for its shared memory segments.
    pub fn directory(&self) -> PathBuf {
        PathBuf::from(format!("/tmp/{}{}", Self::FOLDER, self.0))
    }

    /// Removes all files and segments of the domain on this host, itself, because iceoryx2 removes no segment whose
    /// files are missing. No process may still use the domain.
    ///
    /// # Errors
    /// If a file or segment cannot be removed.
    pub fn remove(&self) -> io::Result<()> {
        let gone = |result: io::Result<()>| match result {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            result => result,
        };
        gone(fs::remove_dir_all(self.directory()))?;
        let Ok(segments) = fs::read_dir(SEGMENTS) else {
            return Ok(());
        };
        let prefix = self.prefix();
        for segment in segments {
            let segment = segment?;
            if segment
                .file_name()
                .as_encoded_bytes()
                .starts_with(prefix.as_bytes())
            {
                gone(fs::remove_file(segment.path()))?;
            }
        }
        Ok(())
    }

    fn prefix(&self) -> String {
        format!("{}_", self.0)
    }

    pub(super) fn config(&self) -> Result<Config, LinkError> {
        let path = self.directory();
        let root = Path::new(path.as_os_str().as_encoded_bytes())
            .map_err(|error| open_error(&self.0, &format!("{error:?}")))?;
        let prefix = FileName::new(self.prefix().as_bytes())
            .map_err(|error| open_error(&self.0, &format!("{error:?}")))?;
        let mut config = Config::default();
        config.global.set_root_path(&root);
        config.global.prefix = prefix;
        Ok(config)
    }
}

impl TryFrom<String> for Domain {
    type Error = DomainError;

    fn try_from(name: String) -> Result<Self, DomainError> {
        Self::new(&name)
    }
}

impl From<Domain> for String {
    fn from(domain: Domain) -> Self {
        domain.0
    }
}

impl std::fmt::Display for Domain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unique_domain_is_a_domain() {
        let domain = Domain::unique();
        assert!(Domain::is_unique_name(domain.as_str()), "{domain}");
        assert_eq!(Domain::new(domain.as_str()), Ok(domain));
    }

    #[test]
    fn names_that_would_not_make_files_are_refused() {
        for name in ["", "a/b", "Ab", "0123456789abcdefg", ".."] {
            assert!(Domain::new(name).is_err(), "{name}");
        }
    }
}
