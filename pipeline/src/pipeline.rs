//! The pipeline: its file, checked and with all names resolved.

mod cells;
mod file;
mod format;
mod outputs;
mod recorded;
mod restart;
mod stage;
pub mod stages;
mod wiring;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_bus::{Keep, Wake};

pub use file::{HostEntry, PipelineFile};
pub use restart::{Restart, When};
pub use stage::entry::{KeepEntry, StageEntry, WakeEntry};
pub use stage::role::{Placement, Role, words_for};
pub use stage::site::{LiveSite, NodeError, ReplaySite, StreamFacts};
pub use stage::{Kind, Settings, StageConfig, StageSettings};
pub use stages::STAGES;

use stage::check::{Check, Purpose, Spot};
use stage::entry::stage_place;
use wiring::Wiring;

use crate::cell::Cell;
use crate::parallel;
use crate::report::{Problem, Report};
use crate::suggest;
use crate::yaml::{self, Located};

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
    /// Edits that replace former keys of the file, which are still accepted.
    pub former_keys: Vec<String>,
}

/// A stage with its inputs resolved.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Its kind and sample types.
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
        let kinds: Vec<&str> = STAGES.iter().map(|kind| kind.key).collect();
        let wiring = wiring::check(file, &kinds, &mut report);
        let cells = cells::resolve(file, &mut report);
        if let Purpose::Run { host: Some(host) } = purpose {
            check_host(&file.value, host, &mut report);
        }
        let mut settings = check_stages(file, purpose, &cells, wiring.as_ref(), &mut report);
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
            let Some(settings) = settings[index].take() else {
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
                    Some(KeepEntry::All) => Keep::All,
                    None => wiring.roles[index].kind.keep,
                },
                wake: match entry.wake {
                    Some(WakeEntry::Spin) => Wake::Spin,
                    Some(WakeEntry::Event) => Wake::Event,
                    None => settings.wake(),
                },
                restart: entry.restart.map_or_else(Restart::default, Restart::from),
                settings,
            });
        }
        let text = file.text().to_owned();
        let former_keys = former_keys(&file);
        Ok(Self {
            path: path.to_owned(),
            text,
            cells,
            hosts: file.value.hosts,
            stages,
            former_keys,
        })
    }
}

/// Checks all stages, and that their outputs are distinct; returns the settings by stage, in the order of the file.
fn check_stages(
    file: &Located<PipelineFile>,
    purpose: Purpose<'_>,
    cells: &BTreeMap<String, Cell>,
    wiring: Option<&Wiring>,
    report: &mut Report,
) -> Vec<Option<Settings>> {
    let count = file.value.stages.len();
    let mut check = Check {
        file,
        purpose,
        cells,
        wiring,
        settings: vec![None; count],
        report,
        slow: Vec::new(),
    };
    let mut order = wiring.map_or_else(|| (0..count).collect(), |wiring| wiring.order.clone());
    // Stages without an output last: a publisher reports facts about twins that are not among its inputs.
    order.sort_by_key(|&index| wiring.is_some_and(|wiring| wiring.roles[index].gives.is_none()));
    for index in order {
        if let Some(part) = check.entry(index).parts.first() {
            let place = stage_place(index).key(part.key);
            check.settings[index] = part.config.check(&mut check, &Spot { index, place });
        }
    }
    outputs::check(&mut check);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let slow = std::mem::take(&mut check.slow);
    let problems = parallel::map(cores, slow, |check| check());
    problems
        .into_iter()
        .flatten()
        .for_each(|problem| check.push(problem));
    check.settings
}

/// Edits that replace former keys, each with its line.
fn former_keys(file: &Located<PipelineFile>) -> Vec<String> {
    let mut edits = Vec::new();
    for (index, entry) in file.value.stages.iter().enumerate() {
        for part in &entry.parts {
            let (former, now) = (part.key, part.config.role().kind.key);
            if former != now {
                let key = file.key_span(&stage_place(index).key(former));
                let line = file.text()[..key.start].matches('\n').count() + 1;
                let name = &entry.name;
                edits.push(format!(
                    "line {line}: `{former}` is the former key of a {now}; in stage `{name}` write `{now}:` instead of `{former}:`"
                ));
            }
        }
    }
    edits
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
