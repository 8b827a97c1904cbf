//! Users who may act, from a file with a line `NAME HASH` for each. The hash is that of a random token of 256 bits,
//! so it is useless to a reader of the file, and no slow hash is needed.

use std::fmt::Write as _;
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use rand::TryRngCore as _;
use rand::rngs::OsRng;
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

/// Maximum length of a name \[bytes\], equal to that in the commands that carry it.
const MAX_NAME_BYTES: usize = 48;
/// Maximum number of users. Resolution: a plant has fewer people at its robots.
const MAX_USERS: usize = 1000;

/// An error of the users file.
#[derive(Debug, thiserror::Error)]
pub enum UsersError {
    /// A file that cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A line that is not a user.
    #[error(
        "{path}:{line}: not a user; a line is a name, a space and the hash that `tauscope fleet --add-user` writes"
    )]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// An invalid name.
    #[error("`{0}` cannot be a user's name: give 1 to 48 letters, digits, `.`, `-`, `_` or `@`")]
    Name(String),
    /// A name that is already taken.
    #[error("there is a user `{0}` already; remove the line to give a new token")]
    Known(String),
    /// A system without random numbers.
    #[error("no random numbers: {0}")]
    Random(String),
}

/// All users.
#[derive(Debug, Clone, Default)]
pub struct Users {
    all: Vec<(String, [u8; 32])>,
}

/// A newly added user.
#[derive(Debug)]
pub struct NewUser {
    /// The name.
    pub name: String,
    /// The token, which is stored nowhere else.
    pub token: String,
}

impl Users {
    /// Returns an empty set of users.
    pub fn none() -> Self {
        Self::default()
    }

    /// Reads the users in a file.
    ///
    /// # Errors
    /// If it cannot be read, or a line is not a user.
    pub fn read(path: &Path) -> Result<Self, UsersError> {
        let text = std::fs::read_to_string(path).map_err(|source| UsersError::File {
            path: path.to_owned(),
            source,
        })?;
        let mut all = Vec::new();
        for (at, line) in text.lines().enumerate() {
            let line_text = line.trim();
            if line_text.is_empty() || line_text.starts_with('#') {
                continue;
            }
            let user = line_text
                .split_once(' ')
                .and_then(|(name, hash)| Some((name.to_owned(), from_hex(hash.trim())?)));
            let sound = user.filter(|(name, _)| is_name(name) && all.len() < MAX_USERS);
            let line = at + 1;
            let path = || path.to_owned();
            all.push(sound.ok_or_else(|| UsersError::Line { path: path(), line })?);
        }
        Ok(Self { all })
    }

    /// Adds a user to a file, and creates the file if necessary.
    ///
    /// # Errors
    /// If the name is invalid or taken, or the file cannot be written.
    pub fn add(path: &Path, name: &str) -> Result<NewUser, UsersError> {
        if !is_name(name) {
            return Err(UsersError::Name(name.to_owned()));
        }
        let users = if path.exists() {
            Self::read(path)?
        } else {
            Self::none()
        };
        if users.all.iter().any(|(known, _)| known == name) {
            return Err(UsersError::Known(name.to_owned()));
        }
        let token = random_hex()?;
        let failed = |source| UsersError::File {
            path: path.to_owned(),
            source,
        };
        let mut file = std::fs::OpenOptions::new()
            .append(true)
            .create(true)
            .mode(0o600)
            .open(path)
            .map_err(failed)?;
        writeln!(file, "{name} {}", hex(&hash(&token))).map_err(failed)?;
        let name = name.to_owned();
        Ok(NewUser { name, token })
    }

    /// Returns whether there are no users.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Returns the user of a token. The comparison takes constant time.
    pub fn of(&self, token: &str) -> Option<&str> {
        let told = hash(token.trim());
        let mut found = None;
        for (name, known) in &self.all {
            if bool::from(known.ct_eq(&told)) {
                found = Some(name.as_str());
            }
        }
        found
    }
}

/// Returns 256 random bits in hexadecimal.
pub(super) fn random_hex() -> Result<String, UsersError> {
    let mut bytes = [0; 32];
    let filled = OsRng.try_fill_bytes(&mut bytes);
    filled.map_err(|error| UsersError::Random(error.to_string()))?;
    Ok(hex(&bytes))
}

fn is_name(name: &str) -> bool {
    let sound = |c: char| c.is_ascii_alphanumeric() || ".-_@".contains(c);
    (1..=MAX_NAME_BYTES).contains(&name.len()) && name.chars().all(sound)
}

fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

fn from_hex(text: &str) -> Option<[u8; 32]> {
    let digits = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let mut bytes = [0; 32];
    for (at, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(text.get(2 * at..2 * at + 2).filter(|_| digits)?, 16).ok()?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_user_is_known_by_the_token_that_was_given_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users");
        let anna = Users::add(&path, "anna").unwrap();
        let ben = Users::add(&path, "ben@plant").unwrap();
        let users = Users::read(&path).unwrap();
        assert_eq!(users.of(&anna.token), Some("anna"));
        assert_eq!(users.of(&format!(" {}\n", ben.token)), Some("ben@plant"));
        assert_eq!(users.of(""), None);
        assert_eq!(users.of(&"0".repeat(64)), None);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(!text.contains(&anna.token), "{text}");
        assert!(matches!(
            Users::add(&path, "anna"),
            Err(UsersError::Known(_))
        ));
        assert!(matches!(
            Users::add(&path, "an na"),
            Err(UsersError::Name(_))
        ));
    }

    #[test]
    fn a_line_that_is_no_user_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("users");
        std::fs::write(&path, "# people\n\nanna 12\n").unwrap();
        let error = Users::read(&path).unwrap_err().to_string();
        assert!(error.contains("users:3: not a user"), "{error}");
        std::fs::write(&path, format!("anna {}", "ä".repeat(32))).unwrap();
        assert!(Users::read(&path).is_err());
    }
}
