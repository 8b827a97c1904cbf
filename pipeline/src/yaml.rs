//! Common loader of all user-written files: pipeline, twin, scenario.
//!
//! A file is read and checked against the schema of its type; every mismatch is reported with its line and column.
//! Only then is it deserialised. Callers check further conditions and report errors in the same text through
//! [`Located`].

mod place;
mod structure;
mod tree;

use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

pub use place::Place;
use place::Spans;

use crate::report::{Problem, Report, Source};

/// Largest accepted file \[bytes\], above any user-written one.
/// Resolution: bounds memory.
const LARGEST_FILE_BYTES: u64 = 4 << 20;

/// A value with the positions of its parts in the file.
#[derive(Debug)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    path: PathBuf,
    source: Arc<Source>,
    spans: Spans,
}

impl<T> Located<T> {
    /// The file's text.
    pub fn text(&self) -> &str {
        &self.source.text
    }

    /// Resolves a path relative to the folder of the file.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// Creates a problem at the value at `place`, or at the nearest enclosing value in the file.
    pub fn at(&self, place: &Place, title: impl Into<String>) -> Problem {
        Problem::at(&self.source, self.span(place), title)
    }

    /// Creates a problem at the key at `place` instead of its value.
    pub fn at_key(&self, place: &Place, title: impl Into<String>) -> Problem {
        Problem::at(&self.source, self.spans.key(place), title)
    }

    /// Range of the key at `place` \[bytes\].
    pub fn key_span(&self, place: &Place) -> Range<usize> {
        self.spans.key(place)
    }

    /// Range of the value at `place` \[bytes\].
    pub fn span(&self, place: &Place) -> Range<usize> {
        self.spans.value(place)
    }
}

/// Reads `path` as a `T`.
///
/// # Errors
/// All errors in the syntax and shape of the file.
pub fn load<T: DeserializeOwned + JsonSchema>(path: &Path) -> Result<Located<T>, Report> {
    parse(path, read(path)?)
}

/// A file that can be checked further although parts of it have the wrong shape.
#[derive(Debug)]
pub struct Examined<T> {
    /// The file without the mismatching parts.
    pub file: Located<T>,
    /// Mismatches of its shape.
    mismatches: Report,
    /// Ranges of the top-level entries with a mismatch \[bytes\].
    entries: Vec<Range<usize>>,
}

impl<T> Examined<T> {
    /// Returns the file, if it has no errors.
    ///
    /// # Errors
    /// The mismatches of its shape, and the later problems `found` outside entries with a mismatch. Problems inside
    /// such entries may only be consequences of the removed parts.
    pub fn into_sound(self, found: Report) -> Result<Located<T>, Report> {
        let mut report = self.mismatches;
        report.append(found.without_those_in(&self.entries));
        report.into_result(self.file)
    }
}

/// Reads `path` as [`load`] does, but keeps the valid entries of a file with mismatches, so that all errors can be
/// reported together.
///
/// # Errors
/// As [`load`], if the file cannot be used without the mismatching parts.
pub fn examine<T: DeserializeOwned + JsonSchema>(path: &Path) -> Result<Examined<T>, Report> {
    let source = Source::new(path, read(path)?);
    let (mut value, spans) = tree::parse(&source)?;
    let mismatches = structure::check::<T>(&source, &value, &spans);
    let wrong = structure::prune::<T>(&mut value);
    let (wrong, value) = match (wrong, deserialize::<T>(&value, &source, &spans)) {
        (Some(wrong), Ok(value)) => (wrong, value),
        (_, read) => {
            mismatches.into_result(())?;
            return Err(read.err().unwrap_or_default());
        }
    };
    let entries = wrong
        .iter()
        .map(|place| spans.value(&place.entry()))
        .collect();
    let path = path.to_owned();
    let file = Located {
        value,
        path,
        source,
        spans,
    };
    Ok(Examined {
        file,
        mismatches,
        entries,
    })
}

/// Deserialises a value that matches the schema.
///
/// All files are deserialised here, because each further call site would instantiate the code for all types again.
fn deserialize<T: DeserializeOwned>(
    value: &serde_json::Value,
    source: &Arc<Source>,
    spans: &Spans,
) -> Result<T, Report> {
    serde_path_to_error::deserialize(value).map_err(|error| {
        let place = Place::from_serde(error.path());
        Problem::at(source, spans.value(&place), error.inner().to_string()).into()
    })
}

/// Parses a text that was read from `path` as a `T`.
///
/// # Errors
/// As [`load`].
pub fn parse<T: DeserializeOwned + JsonSchema>(
    path: &Path,
    text: String,
) -> Result<Located<T>, Report> {
    let source = Source::new(path, text);
    let (value, spans) = tree::parse(&source)?;
    let mismatches = structure::check::<T>(&source, &value, &spans);
    mismatches.into_result(())?;
    let value = deserialize(&value, &source, &spans)?;
    Ok(Located {
        value,
        path: path.to_owned(),
        source,
        spans,
    })
}

fn read(path: &Path) -> Result<String, Report> {
    if let Some(kind) = tauscope_archive::file_kind(path)
        && kind != "empty"
    {
        let title = format!("this is {kind}, not a file that people write");
        let help = "give a pipeline, case, set, scenario or twin file (YAML) here";
        return Err(Problem::of_file(path, title).help(help).into());
    }
    let unreadable = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => Problem::of_file(path, "there is no such file"),
        _ => Problem::of_file(path, format!("cannot read the file: {error}")),
    };
    let file = std::fs::File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(LARGEST_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.len() as u64 > LARGEST_FILE_BYTES {
        let title = format!("the file is larger than {} MiB", LARGEST_FILE_BYTES >> 20);
        return Err(Problem::of_file(path, title).into());
    }
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let source = Source::new(path, String::from_utf8_lossy(error.as_bytes()).into_owned());
        let width = char::REPLACEMENT_CHARACTER.len_utf8();
        Problem::at(&source, valid..valid + width, "the file is not UTF-8")
            .label("not valid from here on")
            .help("save it with the encoding UTF-8")
            .into()
    })
}

#[cfg(test)]
mod tests;
