//! The one loader for all files that people write: pipeline, twin, scenario.
//!
//! A file is read, its shape checked against the schema of its type with every mismatch reported at
//! its line and column, and only then turned into the type. What the schema cannot say is checked
//! afterwards by those who know, who point into the same text through [`Located`].

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

/// More than anybody writes by hand; what is larger is some other file.
/// Resolution: bounds memory.
const LARGEST_FILE_BYTES: u64 = 4 << 20;

/// A value, and where in its file each part of it stands.
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

    /// A path as the file gives it: relative to the folder that the file is in.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// A problem with the value at `place`, or with the nearest thing around it that is in the file.
    pub fn at(&self, place: &Place, title: impl Into<String>) -> Problem {
        Problem::at(&self.source, self.span(place), title)
    }

    /// A problem with the key at `place` rather than its value.
    pub fn at_key(&self, place: &Place, title: impl Into<String>) -> Problem {
        Problem::at(&self.source, self.spans.key(place), title)
    }

    /// Where the key at `place` stands \[bytes\].
    pub fn key_span(&self, place: &Place) -> Range<usize> {
        self.spans.key(place)
    }

    /// Where the value at `place` stands \[bytes\].
    pub fn span(&self, place: &Place) -> Range<usize> {
        self.spans.value(place)
    }
}

/// Reads `path` as a `T`.
///
/// # Errors
/// Everything that is wrong with the file's text and shape.
pub fn load<T: DeserializeOwned + JsonSchema>(path: &Path) -> Result<Located<T>, Report> {
    parse(path, read(path)?)
}

/// A file that can be looked at further although its shape is wrong in places.
#[derive(Debug)]
pub struct Examined<T> {
    /// The file, what is wrong left out of it.
    pub file: Located<T>,
    /// What is wrong with its shape.
    mismatches: Report,
    /// The entries of its top in which something is.
    entries: Vec<Range<usize>>,
}

impl<T> Examined<T> {
    /// The file, if nothing is wrong.
    ///
    /// # Errors
    /// What is wrong with its shape, and of `found`, which was found since, all that is not in an entry
    /// whose shape is wrong: that may only follow from what was left out.
    pub fn into_sound(self, found: Report) -> Result<Located<T>, Report> {
        let mut report = self.mismatches;
        report.append(found.without_those_in(&self.entries));
        report.into_result(self.file)
    }
}

/// As [`load`], but what is wrong with the shape of one entry does not keep the others from being
/// looked at, so that everything wrong is found at once.
///
/// # Errors
/// As [`load`], where the file makes no sense without what is wrong.
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

/// A value that the schema lets pass, as a `T`.
///
/// The only place that deserialises a file: each further one doubles the code that is made to read all types.
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

/// The same from a text that was read from `path`.
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
