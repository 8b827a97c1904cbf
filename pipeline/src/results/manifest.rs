//! A manifest: the recordings to replay, a line of JSON each.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::provenance::sha256_of_file;
use crate::report::{Problem, Report, Source};

/// A recording to replay: a line of a manifest.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// The recording; in the file its path is relative to the manifest.
    pub recording: PathBuf,
    /// SHA-256 of the file, or of all files of a bag's folder in the order of their names.
    pub sha256: String,
    /// Size of the files \[bytes\].
    pub bytes: u64,
    /// Log time of the first message \[ns since the epoch\].
    pub start_ns: i64,
    /// The `ingest` stage that the recording replaces, if the pipeline has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

impl Wanted {
    /// Describes the current content of `recording`; the path is kept as given.
    ///
    /// # Errors
    /// A message if it is no recording, is empty, or cannot be read.
    pub fn of(recording: &Path, source: Option<&str>) -> Result<Self, String> {
        let opened = tauscope_session::open(recording).map_err(|error| error.to_string())?;
        let start_ns = opened.start_ns().ok_or("it holds no message")?;
        let sha256 = sha256_of_file(recording).map_err(|error| error.to_string())?;
        Ok(Self {
            recording: recording.to_owned(),
            sha256,
            bytes: opened.bytes(),
            start_ns,
            source: source.map(str::to_owned),
        })
    }

    /// Whether the recording still has the hash of the manifest.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn is_unchanged(&self) -> std::io::Result<bool> {
        Ok(sha256_of_file(&self.recording)? == self.sha256)
    }
}

/// The recordings to replay.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Manifest {
    /// The recordings in the order of the file, with resolved paths.
    pub wanted: Vec<Wanted>,
}

impl Manifest {
    /// Reads the manifest at `path`. Empty lines are left out.
    ///
    /// # Errors
    /// All problems, each with its line.
    pub fn load(path: &Path) -> Result<Self, Report> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| Problem::of_file(path, error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let source = Source::new(path, text);
        let mut report = Report::default();
        let mut wanted = Vec::new();
        let mut at = 0;
        for line in source.text.split_inclusive('\n') {
            let place = at..at + line.trim_end().len();
            at += line.len();
            if line.trim().is_empty() {
                continue;
            }
            match serde_json::from_str::<Wanted>(line) {
                Ok(mut one) => {
                    one.recording = folder.join(&one.recording);
                    wanted.push(one);
                }
                Err(error) => {
                    let column = error.column().saturating_sub(1).min(place.len());
                    let message = error.to_string();
                    let message = message.split(" at line ").next().unwrap_or(&message);
                    let title = format!("no line of a manifest: {message}");
                    let problem = Problem::at(&source, place.start + column..place.end, title);
                    report.push(problem.help("`tauscope manifest` writes one"));
                }
            }
        }
        if wanted.is_empty() && report.is_empty() {
            report.push(Problem::of_file(path, "the manifest names no recording"));
        }
        report.into_result(Self { wanted })
    }

    /// Formats the file that [`load`](Self::load) reads. Paths of recordings below `folder` are relative to it.
    ///
    /// # Errors
    /// If a path is not valid UTF-8.
    pub fn to_text(&self, folder: &Path) -> serde_json::Result<String> {
        let mut text = String::new();
        for one in &self.wanted {
            let below = one.recording.strip_prefix(folder);
            let recording = below.unwrap_or(&one.recording).to_owned();
            text += &serde_json::to_string(&Wanted {
                recording,
                ..one.clone()
            })?;
            text.push('\n');
        }
        Ok(text)
    }

    /// Keeps every `of`-th recording, starting at `index`, counted from 0.
    #[must_use]
    pub fn shard(mut self, index: usize, of: usize) -> Self {
        let mut place = 0;
        self.wanted.retain(|_| {
            place += 1;
            (place - 1) % of == index
        });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(n: i64) -> Wanted {
        Wanted {
            recording: format!("/archive/day/{n}.mcap").into(),
            sha256: "ab".to_owned(),
            bytes: 5,
            start_ns: n,
            source: None,
        }
    }

    #[test]
    fn what_is_written_is_read_and_the_archive_may_have_moved() {
        let folder = tempfile::tempdir().unwrap();
        let all = Manifest {
            wanted: (0..7).map(wanted).collect(),
        };
        let path = folder.path().join("m.jsonl");
        std::fs::write(&path, all.to_text(Path::new("/archive")).unwrap()).unwrap();
        let read = Manifest::load(&path).unwrap();
        assert_eq!(read.wanted[3].recording, folder.path().join("day/3.mcap"));
        // Every recording is in exactly one shard.
        let mut stamps: Vec<i64> = (0..3)
            .flat_map(|index| read.clone().shard(index, 3).wanted)
            .map(|one| one.start_ns)
            .collect();
        stamps.sort_unstable();
        assert_eq!(stamps, (0..7).collect::<Vec<_>>());
    }

    #[test]
    fn every_wrong_line_is_told_with_its_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.jsonl");
        let good = serde_json::to_string(&wanted(1)).unwrap();
        std::fs::write(&path, format!("{good}\n{{\"recording\": 3}}\n\nno\n")).unwrap();
        let json = Manifest::load(&path).unwrap_err().json();
        let lines: Vec<_> = (0..2).map(|n| json["errors"][n]["line"].clone()).collect();
        assert_eq!(lines, [2, 4], "{json}");
    }
}
