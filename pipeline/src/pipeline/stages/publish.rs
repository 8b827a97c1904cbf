//! A publisher: it serves one cell and listens to the source to which it sends commands.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use tauscope_bus::shell::Node;
use tauscope_bus::{Keep, SampleKind, Wake, ZenohEndpoints};
use tauscope_publish::{Config, ConfigError, Facts, Publisher, Setup, StreamInfo};
use tauscope_record::FileName;

use super::POLL_MS;
use super::twin::TwinSettings;
use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::role::{Placement, Takes};
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};
use crate::provenance::sha256;

/// Smallest number of polls of a publisher within its stop timeout.
/// Resolution: a single late poll must not cause a stop, against wake-ups of the machine.
const POLLS_WITHIN_STOP: u64 = 8;

/// Settings of a publisher.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PublishSettings {
    /// Settings from the pipeline file.
    pub config: Config,
    /// Command endpoints of the cell's source, if any.
    pub commands: Option<ZenohEndpoints>,
    /// Twin and archive of its cell, reported to the fleet.
    pub beside: BesidePublisher,
}

/// Twin and archive in the cell of a publisher.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct BesidePublisher {
    /// SHA-256 of the file of the twin.
    pub twin_sha256: Option<String>,
    /// Standard deviation of the residual at the calibration of that twin, by joint name \[effort unit\].
    pub calibrated: BTreeMap<String, f64>,
    /// Path pattern of the recorder's files.
    pub archive: Option<String>,
}

impl StageConfig for Config {
    type Settings = PublishSettings;

    const KEY: &'static str = "publish";
    const ABOUT: &'static str = "A publisher of contacts and status to the robot's cell, over Zenoh and Modbus. Not a \
                                 safety function.";
    const PLACEMENT: Placement = Placement::Alone;
    /// It must not delay the stages before it.
    const KEEP: Keep = Keep::Newest;
    const HEARS_HEALTH: bool = true;

    fn takes(&self) -> Takes {
        Takes::Many
    }

    fn gives(&self) -> Option<SampleKind> {
        None
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<PublishSettings> {
        let (index, place) = (spot.index, &spot.place);
        let wiring = check.wiring?;
        let one_cell = match wiring.cells[index].len() {
            1 => Ok(()),
            _ => Err(ConfigError::ManyCells),
        };
        let judges = |input: &usize| {
            let role = wiring.roles[*input];
            role.kind.judges_contact && role.gives == Some(SampleKind::Detection)
        };
        let hears_detector = wiring.inputs[index].iter().any(judges);
        let heard = hears_detector.then_some(()).ok_or(ConfigError::NoDetector);
        if let Err(error) = self.check().and(one_cell).and(heard) {
            check.push(check.file.at_key(place, error.to_string()));
            return None;
        }
        let commands = commands(check, index);
        let hears_source = wiring.inputs[index]
            .iter()
            .any(|&input| wiring.roles[input].gives == Some(SampleKind::JointState));
        if commands.is_some() && !hears_source {
            let title = "the source takes commands, but the publisher does not listen to it";
            let problem = check.file.at_key(place, title);
            check.push(problem.help(
                "commands come with the joint states: add the source to the publisher's `inputs`",
            ));
            return None;
        }
        Some(PublishSettings {
            config: self.clone(),
            commands,
            beside: beside(check, index),
        })
    }
}

impl StageSettings for PublishSettings {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        Ok(Node::sink(Box::new(publisher(self, site)?)))
    }

    fn replayed<'n>(&self, _site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        Ok(None)
    }

    /// The latency of a publisher matters for alarms only. Its polls must be frequent enough that a late one is not
    /// mistaken for silence of the detectors.
    fn wake(&self) -> Wake {
        let often = (self.config.stop_after_s * 1e3) as u64 / POLLS_WITHIN_STOP;
        Wake::EveryMsOrUrgent(often.clamp(1, POLL_MS))
    }
}

/// Builds the publisher of a cell.
fn publisher(settings: &PublishSettings, site: &LiveSite<'_>) -> Result<Publisher, NodeError> {
    let cell = site.cell()?;
    let streams = site.streams.iter().map(|stream| StreamInfo {
        stage: stream.stage.clone(),
        kind: stream.kind,
        detector: stream.detector.clone(),
        judges_contact: stream.judges_contact,
    });
    let urdf = cell.facts.urdf.as_ref();
    let joints = cell.facts.joint_names.iter();
    let calibrated = joints.map(|name| settings.beside.calibrated.get(name).copied());
    let setup = Setup {
        cell: cell.facts.name.clone(),
        joint_names: cell.facts.joint_names.clone(),
        model: cell.model.clone(),
        streams: streams.collect(),
        commands: settings.commands.clone(),
        facts: Facts {
            effort_unit: cell.facts.effort_unit.as_str().to_owned(),
            urdf_sha256: urdf.map(|urdf| sha256(urdf.as_bytes())),
            twin_sha256: settings.beside.twin_sha256.clone(),
            calibrated: calibrated.collect(),
            archive: settings.beside.archive.clone(),
        },
        restarted: site.restarts > 0,
    };
    Ok(Publisher::new(&settings.config, &setup)?)
}

/// The twin and the archive of the publisher's cell.
fn beside(check: &Check<'_>, index: usize) -> BesidePublisher {
    let Some(wiring) = check.wiring else {
        return BesidePublisher::default();
    };
    let cells = &wiring.cells[index];
    let stages = || 0..wiring.roles.len();
    let heard = wiring.inputs[index].iter().copied();
    let twin = heard
        .chain(stages().filter(|&at| wiring.cells[at] == *cells))
        .find(|&at| wiring.roles[at].kind.is::<tauscope_twin::Config>());
    let twin = twin.and_then(|twin| check.settings::<TwinSettings>(twin));
    let model = twin.and_then(|twin| twin.model.as_ref());
    let noise = model.iter().flat_map(|model| &model.joints);
    let writes = |at: usize| {
        let cell = (cells.iter()).find(|cell| wiring.cells[at].contains(*cell))?;
        let pattern = |path: &PathBuf| {
            let path = check.file.resolve(path);
            let path = std::path::absolute(&path).unwrap_or(path);
            Some(FileName::parse(&path).ok()?.pattern(cell))
        };
        let names = check
            .entry(at)
            .config::<tauscope_record::Config>()?
            .names_of_alarms();
        let patterns: Vec<String> = names.into_iter().filter_map(pattern).collect();
        (!patterns.is_empty()).then(|| patterns.join(", "))
    };
    BesidePublisher {
        twin_sha256: twin.and_then(|twin| twin.model_sha256.clone()),
        calibrated: noise
            .filter_map(|(name, joint)| Some((name.clone(), joint.noise?)))
            .collect(),
        archive: stages().find_map(writes),
    }
}

/// Command endpoints of the source of the stage's cell.
fn commands(check: &Check<'_>, index: usize) -> Option<ZenohEndpoints> {
    let wiring = check.wiring?;
    let cells = &wiring.cells[index];
    (0..wiring.roles.len())
        .filter(|&at| wiring.cells[at] == *cells)
        .find_map(|at| {
            check
                .entry(at)
                .config::<tauscope_ingest::Config>()?
                .commands
                .clone()
        })
}
