//! `meta/info.json`: the features in a row of the data set, and the paths of its files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};

/// Path in the data set.
pub(super) const INFO: &str = "meta/info.json";
/// Maximum size of the file \[bytes\].
/// Resolution: bounds memory; the file of a data set with a hundred cameras has 100 kB.
const MAX_BYTES: u64 = 8 << 20;
/// Default number of episodes per chunk, as in LeRobot.
const CHUNK: u64 = 1000;

/// The keys of `meta/info.json` that are read.
#[derive(Debug, Deserialize)]
pub(super) struct Info {
    #[serde(default)]
    pub(super) codebase_version: Option<String>,
    #[serde(default)]
    pub(super) total_episodes: u64,
    #[serde(default)]
    chunks_size: Option<u64>,
    /// Rows per second.
    #[serde(default)]
    pub(super) fps: Option<f64>,
    #[serde(default)]
    data_path: Option<String>,
    #[serde(default)]
    pub(super) features: BTreeMap<String, Feature>,
}

/// A column of the table.
#[derive(Debug, Deserialize)]
pub(super) struct Feature {
    #[serde(default)]
    pub(super) dtype: String,
    #[serde(default)]
    shape: Value,
    #[serde(default)]
    names: Value,
}

impl Feature {
    /// Returns whether it is a number or a list of numbers.
    pub(super) fn is_numeric(&self) -> bool {
        let number = self.dtype.starts_with("float") || self.dtype.starts_with("int");
        number && self.width().is_some()
    }

    /// Returns the number of its elements.
    pub(super) fn width(&self) -> Option<usize> {
        match self.shape.as_array()?.as_slice() {
            [width] => usize::try_from(width.as_u64()?).ok(),
            _ => None,
        }
    }

    /// Returns the names of its elements, if given: a list, a list in a list, or a list under a key such as `motors`.
    pub(super) fn names(&self) -> Option<Vec<&str>> {
        let mut lists: Vec<&Value> = vec![&self.names];
        if let Some(object) = self.names.as_object() {
            lists = object.values().collect();
        }
        let names: Option<Vec<&str>> = lists
            .into_iter()
            .flat_map(|list| list.as_array().into_iter().flatten())
            .flat_map(|name| match name.as_array() {
                Some(inner) => inner.iter().collect(),
                None => vec![name],
            })
            .map(Value::as_str)
            .collect();
        names.filter(|names| Some(names.len()) == self.width())
    }
}

impl Info {
    /// Reads the file of the data set in the folder `root`.
    pub(super) fn read(root: &Path) -> Result<Self, ArchiveError> {
        let path = root.join(INFO);
        let broken = |reason: String| {
            ArchiveError::from(LerobotError::new(&path, LerobotProblem::Broken(reason)))
        };
        let mut text = Vec::new();
        let file = File::open(&path).map_err(ArchiveError::io(&path))?;
        let read = file.take(MAX_BYTES + 1).read_to_end(&mut text);
        read.map_err(ArchiveError::io(&path))?;
        if text.len() as u64 > MAX_BYTES {
            return Err(broken(format!("longer than {MAX_BYTES} bytes")));
        }
        let info: Self = serde_json::from_slice(&text)
            .map_err(|error| broken(format!("no description of a LeRobot data set: {error}")))?;
        if info.data_path.is_none() {
            let version = info
                .codebase_version
                .unwrap_or_else(|| "unknown".to_owned());
            let problem = LerobotProblem::Version { version };
            return Err(LerobotError::new(root, problem).into());
        }
        if info.fps.is_some_and(|fps| !fps.is_finite() || fps <= 0.0) {
            return Err(broken("`fps` is no rate".to_owned()));
        }
        Ok(info)
    }

    /// Returns whether each episode has its own file, named by the number of the episode: version 2.
    pub(super) fn has_file_by_episode(&self) -> bool {
        let template = self.data_path.as_deref();
        template.is_some_and(|template| template.contains("{episode_index"))
    }

    /// Returns the file of the episode `number`, relative to the data set: version 2.
    pub(super) fn file_of_episode(&self, number: u64) -> Option<PathBuf> {
        let chunk = number / self.chunks_size.filter(|size| *size > 0).unwrap_or(CHUNK);
        self.fill(&[
            ("episode_chunk", chunk),
            ("chunk_index", chunk),
            ("episode_index", number),
            ("total_episodes", self.total_episodes),
        ])
    }

    /// Returns the file `file` of the chunk `chunk`, relative to the data set: version 3.
    pub(super) fn file_of_chunk(&self, chunk: u64, file: u64) -> Option<PathBuf> {
        self.fill(&[("chunk_index", chunk), ("file_index", file)])
    }

    /// Fills the path template, such as `data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet`. Returns `None`
    /// if it has another placeholder, or leads out of the data set.
    fn fill(&self, numbers: &[(&str, u64)]) -> Option<PathBuf> {
        let mut rest = self.data_path.as_deref()?;
        let mut filled = String::new();
        while let Some((before, behind)) = rest.split_once('{') {
            let (inner, behind) = behind.split_once('}')?;
            let (key, format) = inner.split_once(':').unwrap_or((inner, "d"));
            let (_, number) = numbers.iter().find(|(name, _)| *name == key)?;
            let digits = format.strip_suffix('d')?;
            let width: usize = if digits.is_empty() {
                0
            } else {
                digits.parse().ok()?
            };
            filled.push_str(before);
            filled.push_str(&format!("{number:0width$}", width = width.min(20)));
            rest = behind;
        }
        filled.push_str(rest);
        let path = PathBuf::from(filled);
        let stays = path
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        stays.then_some(path)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use super::*;

    fn info(data_path: &str) -> Info {
        serde_json::from_value(serde_json::json!({"data_path": data_path, "total_episodes": 7}))
            .unwrap()
    }

    #[test]
    fn templates_of_all_versions_are_filled() {
        let two = info("data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet");
        let path = two.file_of_episode(1003).unwrap();
        assert_eq!(path, Path::new("data/chunk-001/episode_001003.parquet"));
        let old = info(
            "data/chunk-{episode_chunk:03d}/train-{episode_index:05d}-of-{total_episodes:05d}.parquet",
        );
        let path = old.file_of_episode(3).unwrap();
        assert_eq!(
            path,
            Path::new("data/chunk-000/train-00003-of-00007.parquet")
        );
        let three = info("data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet");
        let path = three.file_of_chunk(2, 10).unwrap();
        assert_eq!(path, Path::new("data/chunk-002/file-010.parquet"));
    }

    #[test]
    fn a_template_that_leads_elsewhere_is_none() {
        for wrong in [
            "/etc/{episode_index}",
            "../{episode_index}",
            "a/{nobody}",
            "a/{episode_index",
            "{episode_index:x}",
        ] {
            assert_eq!(info(wrong).file_of_episode(0), None, "{wrong}");
        }
    }

    #[test]
    fn names_may_be_given_in_several_ways() {
        for names in [
            serde_json::json!(["a", "b"]),
            serde_json::json!([["a", "b"]]),
            serde_json::json!({"motors": ["a", "b"]}),
        ] {
            let feature = Feature {
                dtype: "float32".to_owned(),
                shape: serde_json::json!([2]),
                names,
            };
            assert_eq!(feature.names(), Some(vec!["a", "b"]));
        }
        for names in [
            Value::Null,
            serde_json::json!(["joints"]),
            serde_json::json!([1, 2]),
        ] {
            let feature = Feature {
                dtype: "float32".to_owned(),
                shape: serde_json::json!([2]),
                names,
            };
            assert_eq!(feature.names(), None);
        }
    }
}
