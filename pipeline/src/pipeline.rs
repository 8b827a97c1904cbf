//! The pipeline file: read, checked, and everything it names looked up.

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

use crate::cell::Cell;
use crate::report::{Problem, Report};
use crate::scenario::ScenarioFacts;
use crate::settings::Settings;
use crate::suggest;
use crate::yaml;

/// How often a recorder or a publisher looks whether samples are there \[ms\].
/// Resolution: how late the picture may be, against how often the machine wakes up.
const LOOKS_MS: u64 = 10;
/// How many times a publisher looks at least before it takes a silence for a stop.
/// Resolution: a look that comes late makes no stop, against how often the machine wakes up.
const LOOKS_WITHIN_STOP: u64 = 8;

/// A pipeline in which nothing is wrong as far as one can tell before it starts.
#[derive(Debug)]
pub struct Pipeline {
    /// The file it was read from.
    pub path: PathBuf,
    /// The file's text, for provenance.
    pub text: String,
    /// The cells by name.
    pub cells: BTreeMap<String, Cell>,
    /// The hosts by name; empty where everything runs on one.
    pub hosts: BTreeMap<String, HostEntry>,
    /// The stages, each after those it listens to.
    pub stages: Vec<Stage>,
    /// SHA-256 of the file that each twin's `model` names, by stage.
    pub model_sha256: BTreeMap<String, String>,
}

/// A stage, its inputs looked up.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// Where it runs, where the file names hosts.
    pub host: Option<String>,
    /// The process it runs in, on that host.
    pub process: String,
    /// Its cell; several for a stage that listens to several.
    pub cells: BTreeSet<String>,
    /// What it listens to, by place in [`Pipeline::stages`].
    pub inputs: Vec<usize>,
    /// What becomes of samples that it has no time for.
    pub keep: Keep,
    /// How it learns that a sample is there.
    pub wake: Wake,
    /// When it is started again.
    pub restart: Restart,
    /// Its own part of the file, paths resolved, files read.
    pub settings: Settings,
    /// What a simulated source simulates.
    pub scenario: Option<ScenarioFacts>,
}

impl Stage {
    /// The stream it puts out: `<cell>/<stage>`. A stage that puts one out has one cell.
    pub fn stream(&self) -> String {
        let cell = self.cells.first().map_or("", String::as_str);
        format!("{cell}/{}", self.name)
    }
}

impl Pipeline {
    /// Reads and checks the file at `path`. Recordings and programs are looked for where their stage
    /// runs: on `host` if one is given, else here for all.
    ///
    /// # Errors
    /// Everything that is wrong, each with its place.
    pub fn load(path: &Path, host: Option<&str>) -> Result<Self, Report> {
        Self::examine(path, Purpose::Run { host })
    }

    /// As [`load`](Self::load), to work on recordings: what only a run reads and writes (the source's own recording,
    /// the recorders' folders, programs) need not be there.
    ///
    /// # Errors
    /// Everything that is wrong, each with its place.
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
                    // Nobody waits for those who are told.
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
        Ok(Self {
            path: path.to_owned(),
            text,
            cells,
            hosts: file.value.hosts,
            stages,
            model_sha256,
        })
    }
}

/// How a stage learns that a sample is there, where the file does not say.
fn wake(settings: &Settings) -> Wake {
    match settings {
        // Nobody waits for a recorder.
        Settings::Record(_) => Wake::EveryMs(LOOKS_MS),
        // And for a publisher only where there is an alarm; but it must not take a pause of its own for a silence.
        Settings::Publish { config, .. } => {
            let often = (config.stop_after_s * 1e3) as u64 / LOOKS_WITHIN_STOP;
            Wake::EveryMsOrUrgent(often.clamp(1, LOOKS_MS))
        }
        _ => Wake::Event,
    }
}

/// What a pipeline is read for.
#[derive(Debug, Clone, Copy)]
enum Purpose<'a> {
    /// To run it on this host; on all if none is named.
    Run { host: Option<&'a str> },
    /// To work on recordings, in place of its sources.
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
