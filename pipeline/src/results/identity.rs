//! Inputs of a replay's result, and the file name derived from them.

use std::collections::BTreeMap;

use super::manifest::Wanted;
use crate::pipeline::Pipeline;
use crate::pipeline::stages::detect::DetectSettings;
use crate::provenance::{sha256, sha256_of_file};
use crate::replay::{TwinChoice, stem};
use crate::report::{Problem, Report};

/// Version of the rows in a result. A change of their columns or meaning needs a new version, which changes all
/// names.
const FORMAT: &str = "tauscope-result/1";

/// All inputs of a pipeline's results, except the recording.
#[derive(Debug, Clone)]
pub struct Identity {
    facts: BTreeMap<String, String>,
}

impl Identity {
    /// Collects the inputs of `pipeline`: its text, the URDFs, the twins, the detectors' learnt parameters and
    /// weights, and the version of this program. `with_scores` adds a row for each judged sample.
    ///
    /// # Errors
    /// If the file of a trained detector cannot be read.
    pub fn of(pipeline: &Pipeline, twin: TwinChoice, with_scores: bool) -> Result<Self, Report> {
        let mut facts = pipeline.provenance();
        facts.insert("format".to_owned(), FORMAT.to_owned());
        facts.insert("twin".to_owned(), format!("{twin:?}").to_lowercase());
        facts.insert("scores".to_owned(), with_scores.to_string());
        for stage in &pipeline.stages {
            let Some(DetectSettings { config, .. }) = stage.settings.get() else {
                continue;
            };
            // The identity depends on the content of the files, not on their paths.
            let mut config = config.clone();
            for (name, path) in config.trained_files_mut() {
                let hash = sha256_of_file(path)
                    .map_err(|error| Problem::of_file(path, error.to_string()))?;
                facts.insert(format!("stages/{}/{name}/weights_sha256", stage.name), hash);
                path.clear();
            }
            // A replay neither reads nor writes the state file.
            if let Some(path) = config.state_mut() {
                path.clear();
            }
            let learnt = serde_json::to_vec(&config)
                .map_err(|error| Problem::new(format!("stage `{}`: {error}", stage.name)))?;
            facts.insert(
                format!("stages/{}/settings_sha256", stage.name),
                sha256(&learnt),
            );
        }
        Ok(Self { facts })
    }

    /// All inputs of the result of `wanted`, by name.
    pub fn facts(&self, wanted: &Wanted) -> BTreeMap<String, String> {
        let mut facts = self.facts.clone();
        facts.insert("recording".to_owned(), stem(&wanted.recording));
        facts.insert("recording_sha256".to_owned(), wanted.sha256.clone());
        if let Some(source) = &wanted.source {
            facts.insert("source".to_owned(), source.clone());
        }
        facts
    }

    /// Key of the result of `wanted`, 64 hexadecimal digits: SHA-256 over [`facts`](Self::facts).
    pub fn key(&self, wanted: &Wanted) -> String {
        hash(&self.facts(wanted))
    }

    /// SHA-256 over all inputs except the recording. Runners with the same hash give the same results.
    pub fn hash(&self) -> String {
        hash(&self.facts)
    }

    /// Path of the result of `wanted`, recorded in `cell`: `cell=CELL/day=YYYY-MM-DD/KEY.parquet`. The day is that of
    /// the recording's first message, in UTC.
    pub fn name(&self, wanted: &Wanted, cell: &str) -> String {
        let day = jiff::Timestamp::from_nanosecond(i128::from(wanted.start_ns)).map_or_else(
            |_| "none".to_owned(),
            |at| at.strftime("%Y-%m-%d").to_string(),
        );
        format!("cell={cell}/day={day}/{}.parquet", self.key(wanted))
    }
}

fn hash(facts: &BTreeMap<String, String>) -> String {
    let mut text = String::new();
    for (name, value) in facts {
        text += &format!("{name}={value}\n");
    }
    sha256(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(name: &str, sha256: &str) -> Wanted {
        Wanted {
            recording: name.into(),
            sha256: sha256.to_owned(),
            bytes: 1,
            start_ns: 1_767_225_600_000_000_000,
            source: None,
        }
    }

    #[test]
    fn the_name_depends_on_content_and_name_not_on_the_folder() {
        let facts = BTreeMap::from([("pipeline_sha256".to_owned(), "1".to_owned())]);
        let identity = Identity { facts };
        let name = |recording: &str, sha256: &str| identity.name(&wanted(recording, sha256), "c");
        assert_eq!(name("a/x.mcap", "7"), name("b/x.mcap", "7"));
        assert_ne!(name("a/x.mcap", "7"), name("a/x.mcap", "8"));
        assert!(name("x.mcap", "7").starts_with("cell=c/day=2026-01-01/"));
    }
}
