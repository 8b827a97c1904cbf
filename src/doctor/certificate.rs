//! Validity of certificates and usability of private keys.

use std::path::Path;

use x509_parser::pem::Pem;

/// Checks that a file holds a private key in PEM form.
pub(super) fn usable_key(path: &Path) -> Result<(), String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let mut blocks = Pem::iter_from_buffer(&bytes).filter_map(Result::ok);
    if blocks.any(|block| block.label.ends_with("PRIVATE KEY")) {
        Ok(())
    } else {
        Err("no private key (PEM) is in it".to_owned())
    }
}

/// Returns start and end of the validity of a file's certificates \[s since the epoch\]; of several, that of their
/// common period.
pub(super) fn validity(path: &Path) -> Result<(i64, i64), String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let mut valid: Option<(i64, i64)> = None;
    for block in Pem::iter_from_buffer(&bytes) {
        let block = block.map_err(|error| error.to_string())?;
        if block.label != "CERTIFICATE" {
            continue;
        }
        let certificate = block.parse_x509().map_err(|error| error.to_string())?;
        let of = certificate.validity();
        let (from, to) = (of.not_before.timestamp(), of.not_after.timestamp());
        valid = Some(valid.map_or((from, to), |(start, end)| (start.max(from), end.min(to))));
    }
    valid.ok_or_else(|| "no certificate (PEM) is in it".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_certificate_is_no_private_key_and_a_missing_file_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.key");
        assert!(usable_key(&path).is_err());
        let block = |label: &str| format!("-----BEGIN {label}-----\nAAAA\n-----END {label}-----\n");
        std::fs::write(&path, block("CERTIFICATE")).unwrap();
        let why = usable_key(&path).unwrap_err();
        assert!(why.contains("no private key"), "{why}");
        std::fs::write(&path, block("EC PRIVATE KEY")).unwrap();
        assert_eq!(usable_key(&path), Ok(()));
    }
}
