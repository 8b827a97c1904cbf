//! How long a certificate holds.

use std::path::Path;

use x509_parser::pem::Pem;

/// From when to when it holds \[s since the epoch\]: of several in one file, the time that all do.
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
