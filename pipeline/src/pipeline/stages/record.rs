//! A recorder: its file names and folders checked, and its files renamed in a replay.

mod redirect;

use std::collections::BTreeMap;
use std::path::Path;

use tauscope_archive::whole_file;
use tauscope_bus::shell::Node;
use tauscope_bus::{SampleKind, Wake};
use tauscope_record::{CellInfo, Config, RecordError, Recorder, StreamInfo};

use super::POLL_MS;
use crate::cell::{Cell, EffortUnit};
use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::role::{Placement, Takes};
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite, StreamFacts};
use crate::pipeline::stage::{StageConfig, StageSettings};

pub use redirect::redirect;

impl StageConfig for Config {
    type Settings = Self;

    const KEY: &'static str = "record";
    const ABOUT: &'static str = "A recorder of archives and pictures.";
    const PLACEMENT: Placement = Placement::Alone;
    const HEARS_HEALTH: bool = true;

    fn takes(&self) -> Takes {
        Takes::Many
    }

    fn gives(&self) -> Option<SampleKind> {
        None
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<Self> {
        let mut config = self.clone();
        if !config.writes_something() {
            let problem = check
                .file
                .at_key(&spot.place, "a recorder that writes nothing");
            check.push(
                problem.help("give `mcap: out/archive.mcap`, or `rerun: {file: out/picture.rrd}`"),
            );
            return None;
        }
        for path in config.all_names_mut() {
            *path = check.file.resolve(path);
        }
        if let Err(error) = config.check_names() {
            let problem = check.file.at_key(&spot.place, error.to_string());
            check.push(problem.help("for example `mcap: out/{date}/{time}.mcap`"));
            return None;
        }
        if check.is_here(spot.index) {
            are_files(check, spot, &mut config)?;
            can_be_written(check, spot, &config)?;
        }
        Some(config)
    }
}

impl StageSettings for Config {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        let cells: Vec<&Cell> = site.cells.iter().collect();
        let mut recorder = recorder(self, &cells, site.streams, site.provenance)?;
        recorder.repair_leftovers(self);
        Ok(Node::sink(Box::new(recorder)))
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        let Some(config) = redirect(self, site.out, site.recording, site.files) else {
            return Ok(None);
        };
        let streams = site.pipeline.streams(site.inputs);
        let cells = site.pipeline.cells_of(&streams);
        let recorder = recorder(&config, &cells, &streams, &site.pipeline.provenance())?;
        Ok(Some(Node::sink(Box::new(recorder))))
    }

    /// The latency of a recorder does not matter.
    fn wake(&self) -> Wake {
        Wake::EveryMs(POLL_MS)
    }
}

/// Checks that the recorder's names are those of files, not of folders.
fn are_files(check: &mut Check<'_>, spot: &Spot, config: &mut Config) -> Option<()> {
    let cells = check.wiring.map(|wiring| &wiring.cells[spot.index]);
    let cell = cells.and_then(|cells| cells.first());
    let cell = cell.map_or("", String::as_str).to_owned();
    let ends = |path: &Path| path.to_string_lossy().ends_with('/');
    let given = config.all_names_mut().find(|path| ends(path)).cloned();
    let there = || config.in_the_way(&cell).into_iter().find(|p| p.is_dir());
    let Some(folder) = given.or_else(there) else {
        return Some(());
    };
    let title = format!("{} is a folder, no file", folder.display());
    let problem = check.file.at_key(&spot.place, title);
    check.push(problem.help("name a file in it, for example `{date}-{time}.mcap`"));
    None
}

/// Checks that this user may write to the recorder's folders.
fn can_be_written(check: &mut Check<'_>, spot: &Spot, config: &Config) -> Option<()> {
    let cells = check.wiring.map(|wiring| &wiring.cells[spot.index]);
    let cell = cells.and_then(|cells| cells.first());
    let mut folders = config.folders(cell.map_or("", String::as_str));
    folders.dedup();
    for folder in folders {
        if let Err(error) = whole_file::check_writable(&folder) {
            let shown = if folder == Path::new("") {
                Path::new(".")
            } else {
                &folder
            };
            let title = format!("cannot write into {}: {error}", shown.display());
            let problem = check.file.at_key(&spot.place, title);
            check.push(
                problem.help(
                    "give a folder that this user may write to, or change its owner or rights",
                ),
            );
            return None;
        }
    }
    Some(())
}

/// Builds a recorder of `streams`, which belong to `cells`.
///
/// # Errors
/// If cells, streams and file names are inconsistent, or a file cannot be created.
fn recorder(
    config: &Config,
    cells: &[&Cell],
    streams: &[StreamFacts],
    provenance: &BTreeMap<String, String>,
) -> Result<Recorder, RecordError> {
    let units = |name: &str| {
        let cell = cells.iter().find(|cell| cell.facts.name == name);
        cell.map(|cell| cell.facts.effort_unit).unwrap_or_default()
    };
    let infos: Vec<CellInfo> = cells
        .iter()
        .map(|cell| CellInfo {
            name: cell.facts.name.clone(),
            joint_names: cell.facts.joint_names.clone(),
            model: cell.model.clone(),
            effort_unit: cell.facts.effort_unit.as_str().to_owned(),
        })
        .collect();
    let streams: Vec<StreamInfo> = streams
        .iter()
        .map(|stream| StreamInfo {
            stage: stream.stage.clone(),
            cell: stream.cell.clone(),
            kind: stream.kind,
            detector: stream.detector.clone(),
            score_unit: score_unit(stream, units(&stream.cell)).to_owned(),
        })
        .collect();
    Recorder::new(config, &infos, &streams, provenance)
}

/// Unit of the scores in a stream; empty if it has no scores or their unit is unknown.
fn score_unit(stream: &StreamFacts, effort: EffortUnit) -> &'static str {
    let entry = stream
        .detector
        .as_deref()
        .and_then(tauscope_detect::Entry::find);
    entry.map_or("", |entry| entry.score_unit.in_words(effort))
}
