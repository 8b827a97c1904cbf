//! The pipeline: its file, checked and with all names resolved.

mod cells;
mod entries;
mod file;
mod recorded;
mod restart;
mod role;
mod wiring;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_bus::{Keep, Wake};

pub use file::{HostEntry, KeepEntry, PipelineFile, WakeEntry};
pub use restart::{Restart, When};
pub use role::{ROLE_KEYS, Role, words_for};

use file::{StageEntry, stage_place};
use role::FORMER_WATCH_KEY;

use crate::cell::Cell;
use crate::report::{Problem, Report};
use crate::scenario::ScenarioFacts;
use crate::settings::Settings;
use crate::suggest;
use crate::yaml::{self, Located};

/// Poll interval of recorders and publishers for new samples \[ms\].
/// Resolution: latency of the live picture, against wake-ups of the machine.
const LOOKS_MS: u64 = 10;
/// Smallest number of polls of a publisher within its stop timeout.
/// Resolution: a single late poll must not cause a stop, against wake-ups of the machine.
const LOOKS_WITHIN_STOP: u64 = 8;

/// A pipeline that passed all checks before its start.
#[derive(Debug)]
pub struct Pipeline {
    /// Path of the file.
    pub path: PathBuf,
    /// Text of the file, for provenance.
    pub text: String,
    /// The cells by name.
    pub cells: BTreeMap<String, Cell>,
    /// The hosts by name; empty if everything runs on one host.
    pub hosts: BTreeMap<String, HostEntry>,
    /// The stages, each after its inputs.
    pub stages: Vec<Stage>,
    /// SHA-256 of the file that each twin's `model` names, by stage.
    pub model_sha256: BTreeMap<String, String>,
    /// Edits that replace former keys of the file, which are still accepted.
    pub former_keys: Vec<String>,
}

/// A stage with its inputs resolved.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Kind of the stage.
    pub role: Role,
    /// The host it runs on, if the file names hosts.
    pub host: Option<String>,
    /// The process it runs in, on that host.
    pub process: String,
    /// Its cell; several for a stage that listens to several cells.
    pub cells: BTreeSet<String>,
    /// Indices of its inputs in [`Pipeline::stages`].
    pub inputs: Vec<usize>,
    /// Overflow policy of its inputs.
    pub keep: Keep,
    /// Wake-up on a new sample.
    pub wake: Wake,
    /// Restart policy.
    pub restart: Restart,
    /// Its settings, with paths resolved and files read.
    pub settings: Settings,
    /// Scenario of a simulated source.
    pub scenario: Option<ScenarioFacts>,
}

impl Stage {
    /// Name of its output stream: `<cell>/<stage>`. A stage with an output has one cell.
    pub fn stream(&self) -> String {
        let cell = self.cells.first().map_or("", String::as_str);
        format!("{cell}/{}", self.name)
    }
}

impl Pipeline {
    /// Reads and checks the file at `path`. Recordings and programs must exist on the host of their stage: they are
    /// checked for the stages of `host`, or for all stages if no host is given.
    ///
    /// # Errors
    /// All problems, each with its place.
    pub fn load(path: &Path, host: Option<&str>) -> Result<Self, Report> {
        Self::examine(path, Purpose::Run { host })
    }

    /// Loads the file as [`load`](Self::load) does, for work on recordings. Files that only a run needs (the source's
    /// own recording, the recorders' folders, programs) may be missing.
    ///
    /// # Errors
    /// All problems, each with its place.
    pub fn load_to_replay(path: &Path) -> Result<Self, Report> {
        Self::examine(path, Purpose::Replay)
    }

    fn examine(path: &Path, purpose: Purpose<'_>) -> Result<Self, Report> {
        let examined = yaml::examine::<PipelineFile>(path)?;
        let file = &examined.file;
        let mut report = Report::default();
        let wiring = wiring::check(file, &mut report);
        let cells = cells::resolve(file, &mut report);
        if let Purpose::Run { host: Some(host) } = purpose {
            check_host(&file.value, host, &mut report);
        }
        let mut files = entries::resolve(file, purpose, &cells, wiring.as_ref(), &mut report);
        let file = examined.into_sound(report)?;
        let Some(wiring) = wiring else {
            return Err(Problem::of_file(path, "the stages make no pipeline").into());
        };
        let mut position = vec![0; wiring.order.len()];
        for (at, &index) in wiring.order.iter().enumerate() {
            position[index] = at;
        }
        let mut stages = Vec::new();
        for &index in &wiring.order {
            let Some(settings) = files.settings[index].take() else {
                continue;
            };
            let entry = &file.value.stages[index];
            stages.push(Stage {
                name: entry.name.clone(),
                role: wiring.roles[index],
                host: wiring.hosts[index].clone(),
                process: wiring.processes[index].clone(),
                cells: wiring.cells[index].clone(),
                inputs: wiring.inputs[index]
                    .iter()
                    .map(|&input| position[input])
                    .collect(),
                keep: match entry.keep {
                    Some(KeepEntry::Newest) => Keep::Newest,
                    // A publisher must not delay the stages before it.
                    None if wiring.roles[index] == Role::Publish => Keep::Newest,
                    Some(KeepEntry::All) | None => Keep::All,
                },
                wake: match entry.wake {
                    Some(WakeEntry::Spin) => Wake::Spin,
                    Some(WakeEntry::Event) => Wake::Event,
                    None => wake(&settings),
                },
                restart: entry.restart.map_or_else(Restart::default, Restart::from),
                settings,
                scenario: files.scenarios.remove(&index),
            });
        }
        let text = file.text().to_owned();
        let model_sha256 = files.model_sha256;
        let former_keys = former_keys(&file);
        Ok(Self {
            path: path.to_owned(),
            text,
            cells,
            hosts: file.value.hosts,
            stages,
            model_sha256,
            former_keys,
        })
    }
}

/// Edits that replace former keys, each with its line.
fn former_keys(file: &Located<PipelineFile>) -> Vec<String> {
    let stages = file.value.stages.iter().enumerate();
    let is_former = |(_, entry): &(usize, &StageEntry)| entry.explain.is_some();
    let edit = |(index, entry): (usize, &StageEntry)| {
        let key = file.key_span(&stage_place(index).key(FORMER_WATCH_KEY));
        let line = file.text()[..key.start].matches('\n').count() + 1;
        let name = &entry.name;
        format!(
            "line {line}: `{FORMER_WATCH_KEY}` is the former key of a watch; in stage `{name}` write `watch:` instead of `{FORMER_WATCH_KEY}:`"
        )
    };
    stages.filter(is_former).map(edit).collect()
}

/// Default wake-up of a stage.
fn wake(settings: &Settings) -> Wake {
    match settings {
        // The latency of a recorder does not matter.
        Settings::Record(_) => Wake::EveryMs(LOOKS_MS),
        // The latency of a publisher matters for alarms only. Its polls must be frequent enough that a late one is
        // not mistaken for silence of the detectors.
        Settings::Publish { config, .. } => {
            let often = (config.stop_after_s * 1e3) as u64 / LOOKS_WITHIN_STOP;
            Wake::EveryMsOrUrgent(often.clamp(1, LOOKS_MS))
        }
        _ => Wake::Event,
    }
}

/// Purpose for which a pipeline is loaded.
#[derive(Debug, Clone, Copy)]
enum Purpose<'a> {
    /// Run on this host; on all hosts if `None`.
    Run { host: Option<&'a str> },
    /// Replay of recordings in place of its sources.
    Replay,
}

fn check_host(file: &PipelineFile, host: &str, report: &mut Report) {
    if file.hosts.contains_key(host) {
        return;
    }
    let title = format!("the pipeline has no host `{host}`");
    let help = if file.hosts.is_empty() {
        Some("it names none: leave `--host` out".to_owned())
    } else {
        suggest::help(host, "the hosts are", file.hosts.keys().map(String::as_str))
    };
    report.push(Problem::new(title).maybe_help(help));
}
