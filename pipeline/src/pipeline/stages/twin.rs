//! A twin: its model read and checked, and its effort recomputed or read from the archive.

use serde::{Deserialize, Serialize};
use tauscope_bus::SampleKind;
use tauscope_bus::shell::Node;
use tauscope_ingest::{ArchivedTwin, ArchivedTwinTopics};
use tauscope_twin::{Config, Expected, Filters, Motion, TwinFile};

use super::ingest;
use crate::build;
use crate::cell::Cell;
use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::entry::stage_place;
use crate::pipeline::stage::role::Takes;
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};
use crate::plausible::{PlausibleTwin, WatchedTwin};
use crate::provenance;
use crate::yaml::{self, Place};

/// Settings of a twin.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TwinSettings {
    /// Settings from the pipeline file.
    pub config: Config,
    /// Content of the file that `model` names.
    pub model: Option<TwinFile>,
    /// SHA-256 of that file.
    pub model_sha256: Option<String>,
}

impl TwinSettings {
    /// The low-passes: those of the pipeline file, else those of the model.
    pub fn filters(&self) -> Filters {
        let model = self.model.as_ref();
        self.config.filters(model.map(|model| model.filters))
    }
}

impl StageConfig for Config {
    type Settings = TwinSettings;

    const KEY: &'static str = "twin";
    const ABOUT: &'static str = "The twin, which computes the expected effort.";

    fn takes(&self) -> Takes {
        Takes::One(SampleKind::JointState)
    }

    fn gives(&self) -> Option<SampleKind> {
        Some(SampleKind::TwinState)
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<TwinSettings> {
        topics_for(check, spot.index, &spot.place, self);
        let (model, model_sha256) = if self.model.is_some() {
            let (model, sha256) = read_model(check, spot, self)?;
            (Some(model), Some(sha256))
        } else {
            (None, None)
        };
        let cell = check.cell(spot.index);
        if let Some(cell) = cell
            && let Err(error) = build::twin(self, model.as_ref(), cell)
        {
            let place = if self.model.is_some() {
                spot.place.key("model")
            } else {
                spot.place.clone()
            };
            check.push(check.file.at_key(&place, error.to_string()));
            return None;
        }
        if let (Some(cell), Some(model)) = (cell, &model) {
            model_fits(check, &spot.place, self, model, cell);
        }
        Some(TwinSettings {
            config: self.clone(),
            model,
            model_sha256,
        })
    }
}

/// The model of the twin upstream of a stage, if it has one. `None` if that twin is invalid, which is already reported.
pub fn model_above(check: &Check<'_>, index: usize) -> Option<Option<TwinFile>> {
    let Some(twin) = check.above::<Config>(index) else {
        return Some(None);
    };
    let twin = check.settings::<TwinSettings>(twin)?;
    Some(twin.model.clone())
}

/// Reads the model that `config` names, with its SHA-256.
fn read_model(check: &mut Check<'_>, spot: &Spot, config: &Config) -> Option<(TwinFile, String)> {
    let path = check.file.resolve(config.model.as_ref()?);
    let place = spot.place.key("model");
    if !path.exists() {
        let problem = check
            .file
            .at(&place, format!("there is no twin {}", path.display()));
        let help = "`tauscope calibrate` makes one; without `model` the twin is the URDF's";
        check.push(problem.help(help));
        return None;
    }
    let model = match yaml::load::<TwinFile>(&path) {
        Ok(model) => model,
        Err(problems) => {
            check.report.append(problems);
            return None;
        }
    };
    let wrong = check.cell(spot.index).and_then(|cell| {
        let facts = &cell.facts;
        let unit = facts.effort_unit.as_str();
        model.value.resolve(&facts.joint_names, unit).err()
    });
    if let Some(error) = wrong {
        check.push(check.file.at(&place, error.to_string()));
        return None;
    }
    let sha256 = provenance::sha256(model.text().as_bytes());
    Some((model.value, sha256))
}

impl StageSettings for TwinSettings {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        let (model, cell) = (self.model.as_ref(), site.cell()?);
        let twin = build::twin(&self.config, model, cell)?;
        let plausible = PlausibleTwin::new(&self.config, model, cell);
        let twin = WatchedTwin::new(site.stage, twin, plausible);
        Ok(Node::stage(Box::new(twin)))
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        if !site.keeps_twin {
            let twin = build::twin(&self.config, self.model.as_ref(), site.cell)?;
            return Ok(Some(Node::stage(Box::new(twin))));
        }
        let topics = ArchivedTwinTopics {
            state: ingest::file_config(site.source, site.recording)
                .topics
                .state,
            ..ArchivedTwinTopics::default()
        };
        let setup = build::ingest_setup(site.cell);
        let twin = ArchivedTwin::open(site.recording, &topics, site.source, &setup)?;
        Ok(Some(Node::source(Box::new(twin))))
    }
}

/// Checks that the source reads the topics that the twin needs.
fn topics_for(check: &mut Check<'_>, index: usize, place: &Place, config: &Config) {
    let Some(source) = check.above::<tauscope_ingest::Config>(index) else {
        return;
    };
    let Some(ingest) = check.entry(source).config::<tauscope_ingest::Config>() else {
        return;
    };
    let Ok((key, settings)) = ingest.source() else {
        return;
    };
    let wanted = config.expected == Expected::Topic;
    if let Some(help) = settings.without_twin().filter(|_| wanted) {
        let title = "the source reads no other twin's effort for this";
        let problem = check.file.at(&place.key("expected"), title);
        check.push(problem.help(help));
    }
    let Some(topics) = settings.topics() else {
        return;
    };
    let source_place = stage_place(source).key("ingest").key(key).key("topics");
    let wants = [
        (
            config.motion == Motion::Commanded,
            &topics.command,
            "motion",
            "command",
        ),
        (
            config.expected == Expected::Topic,
            &topics.twin,
            "expected",
            "twin",
        ),
    ];
    for (wanted, topic, twin_key, topic_key) in wants {
        if wanted && topic.is_none() {
            let name = &check.entry(source).name;
            let title = format!("the source `{name}` reads no `{topic_key}` topic for this");
            let problem = check
                .file
                .at(&place.key(twin_key), title)
                .also(check.file.key_span(&source_place), "its topics")
                .help(format!("name it there: `{topic_key}: /its/name`"));
            check.push(problem);
        }
    }
}

/// Checks that the model was made for this robot and with these filters. Behind others its noise, and the
/// thresholds based on its scores, are invalid.
fn model_fits(
    check: &mut Check<'_>,
    place: &Place,
    config: &Config,
    model: &TwinFile,
    cell: &Cell,
) {
    if let Some(robot) = &cell.model
        && let Some(title) = model.made_for_other(robot.name())
    {
        let problem = check.file.at(&place.key("model"), title);
        check.push(problem.help("calibrate one for this robot: `tauscope calibrate`"));
    }
    if model.scores.is_empty() {
        return;
    }
    let mut own = model.joints.values().filter_map(|j| j.effort_cutoff_hz);
    if config.effort_cutoff_hz.is_some() && own.next().is_some() {
        let title = "`effort_cutoff_hz` is given, but the twin's model has low-passes by joint";
        let problem = check.file.at(&place.key("effort_cutoff_hz"), title);
        let help = "leave it out, or calibrate anew with --effort-cutoff-hz: its thresholds hold for no other";
        check.push(problem.help(help));
        return;
    }
    let cutoffs = [
        (
            "velocity_cutoff_hz",
            config.velocity_cutoff_hz,
            model.filters.velocity_cutoff_hz,
        ),
        (
            "effort_cutoff_hz",
            config.effort_cutoff_hz,
            model.filters.effort_cutoff_hz,
        ),
    ];
    for (key, here, there) in cutoffs {
        #[expect(
            clippy::float_cmp,
            reason = "both were written by people, not computed"
        )]
        let other = here.filter(|here| *here != there);
        if let Some(here) = other {
            let title = format!("`{key}` is {here}, but the twin's model was made with {there}");
            let problem = check.file.at(&place.key(key), title);
            let help = format!(
                "leave it out or give `{key}: {there}`, or calibrate anew: its thresholds hold for no other"
            );
            check.push(problem.help(help));
        }
    }
}
