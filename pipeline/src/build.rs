//! Builds stages from their settings, in the same way for `run`, `replay` and the check. The check builds every twin
//! and detector to validate its settings.

use std::collections::BTreeMap;
use std::task::Waker;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tauscope_bus::{
    Emit, JointState, LinkError, Progress, SampleKind, Source, StageError, Trouble, ZenohEndpoints,
};
use tauscope_detect::Detect;
use tauscope_dynamics::{Link, Model};
use tauscope_ingest::{Commanded, IngestError, Paced, Rate, SimulatedRobot, Takes};
use tauscope_publish::{PublishError, Publisher};
use tauscope_record::{CellInfo, RecordError, Recorder, StreamInfo};
use tauscope_twin::{Correction, Expected, Twin, TwinFile};
use tauscope_watch::{self as watch, Watch};

use crate::cell::{Cell, EffortUnit};
use crate::provenance::sha256;
use crate::settings::BesidePublisher;
use crate::trained;

/// Error while building a stage.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// A twin file that does not fit the cell.
    #[error(transparent)]
    TwinFile(#[from] tauscope_twin::TwinFileError),
    /// Invalid settings of the twin.
    #[error(transparent)]
    Twin(#[from] tauscope_twin::TwinError),
    /// Invalid settings of the detector.
    #[error(transparent)]
    Detect(#[from] tauscope_detect::ConfigError),
    /// An invalid or unreadable file of a trained detector.
    #[error(transparent)]
    Trained(#[from] trained::TrainedFileError),
}

/// Properties of `cell` that its source needs.
pub fn ingest_setup(cell: &Cell) -> tauscope_ingest::Setup {
    tauscope_ingest::Setup {
        cell: cell.facts.name.clone(),
        joint_names: cell.facts.joint_names.clone(),
        effort_limits: cell.effort_limits(),
        tool: cell
            .facts
            .tool
            .as_ref()
            .filter(|tool| tool.mass_kg > 0.0)
            .map(|tool| tauscope_ingest::Tool {
                mass_kg: tool.mass_kg,
                com_m: tool.com_m,
                inertia_kgm2: tool.inertia_kgm2,
            }),
        has_tool_link: cell.tool_link().is_some(),
    }
}

/// Adds commands to a source of `cell`: live ones from the endpoints of its configuration, otherwise those of the
/// archive. Requests to learn are accepted if `somebody_learns`.
///
/// # Errors
/// If the command endpoints cannot be opened.
pub fn commanded(
    source: Box<dyn Source<JointState>>,
    config: &tauscope_ingest::Config,
    cell: &Cell,
    somebody_learns: bool,
) -> Result<Commanded, LinkError> {
    match &config.commands {
        Some(endpoints) => {
            let links = cell.model.as_ref().map(Model::links);
            let arm_kg = links.map(|links| links.iter().map(Link::mass_kg).sum::<f64>());
            let takes = Takes {
                learn: somebody_learns,
                arm_kg: arm_kg.filter(|kg| *kg > 0.0),
            };
            Commanded::live(source, &ingest_setup(cell), endpoints, takes)
        }
        None => Ok(Commanded::archived(source)),
    }
}

/// Opens the source of `cell`. A restarted source that reads a file continues after the sample with the stamp
/// `after_ns`.
///
/// # Errors
/// If the source cannot be opened; [`IngestError::is_input`] separates input errors from failures.
pub fn ingest(
    config: &tauscope_ingest::Config,
    robot: Option<&SimulatedRobot>,
    cell: &Cell,
    after_ns: Option<i64>,
) -> Result<Box<dyn Source<JointState>>, IngestError> {
    let setup = ingest_setup(cell);
    // A live source cannot repeat past samples.
    let (_, source) = config.source()?;
    let Some(after_ns) = after_ns.filter(|_| source.file().is_some()) else {
        return tauscope_ingest::open(config, &setup, robot);
    };
    // Samples emitted before the restart are skipped at full speed; pacing starts after them.
    let fast = tauscope_ingest::Config {
        rate: Rate::Fast,
        ..config.clone()
    };
    let rest = After {
        inner: tauscope_ingest::open(&fast, &setup, robot)?,
        after_ns,
    };
    Ok(match config.rate.factor() {
        Some(factor) => Box::new(Paced::new(rest, factor)),
        None => Box::new(rest),
    })
}

/// A source that skips the samples up to a stamp.
struct After {
    inner: Box<dyn Source<JointState>>,
    after_ns: i64,
}

struct EmitAfter<'a> {
    out: &'a mut dyn Emit<JointState>,
    after_ns: i64,
}

impl Emit<JointState> for EmitAfter<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let mut sample = JointState::default();
        write(&mut sample);
        if sample.header.stamp_ns <= self.after_ns {
            return Ok(());
        }
        self.out.emit(&mut |slot| *slot = sample)
    }
}

impl Source<JointState> for After {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        self.inner.step(&mut EmitAfter {
            out,
            after_ns: self.after_ns,
        })
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.inner.register(waker)
    }

    fn dropped(&self) -> u64 {
        self.inner.dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        self.inner.fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        self.inner.trouble(silent_for)
    }
}

/// The correction of `model` for `cell`; without a model, friction, rotor inertias and springs of the robot's file.
///
/// # Errors
/// If the model does not fit the cell.
pub fn correction(model: Option<&TwinFile>, cell: &Cell) -> Result<Correction, BuildError> {
    let joints = &cell.facts.joint_names;
    Ok(match model {
        Some(model) => model.resolve(joints, cell.facts.effort_unit.as_str())?,
        None => Correction {
            terms: cell.stated_terms(),
            ..Correction::none(joints.len())
        },
    })
}

/// Builds a twin of `cell`.
///
/// # Errors
/// If the model does not fit the cell, or the twin cannot be built from its configuration.
pub fn twin(
    config: &tauscope_twin::Config,
    model: Option<&TwinFile>,
    cell: &Cell,
) -> Result<Twin, BuildError> {
    let setup = tauscope_twin::Setup {
        model: cell.model.clone(),
        joint_names: cell.facts.joint_names.clone(),
        torque_constants_nm_per_a: cell.facts.torque_constants_nm_per_a.clone(),
        tool_link: cell.tool_link(),
    };
    let mut correction = correction(model, cell)?;
    // An external twin already includes the friction of its own model.
    if model.is_none() && config.expected == Expected::Topic {
        correction.terms.clear();
    }
    if config.effort_cutoff_hz.is_some() {
        // The configured cutoff overrides those of the model for all joints.
        for joint in &mut correction.joints {
            joint.effort_cutoff_hz = None;
        }
    }
    let config = config
        .clone()
        .with(config.filters(model.map(|model| model.filters)));
    Ok(Twin::new(&config, setup, correction)?)
}

/// Builds a detector behind a twin of `cell` with this `model`; `shared` is the state it shares with other detectors.
///
/// # Errors
/// If the model does not fit the cell, a trained file cannot be read, or the configuration is invalid.
pub fn detect(
    config: &tauscope_detect::Config,
    model: Option<&TwinFile>,
    cell: &Cell,
    shared: Option<tauscope_detect::Shared>,
) -> Result<Detect, BuildError> {
    let mut setup = detect_setup(model, cell)?;
    setup.shared = shared;
    trained::read(config, &mut setup)?;
    Ok(config.stage(setup)?)
}

/// Properties of `cell` and of its twin with this `model` that a detector needs.
///
/// # Errors
/// If the model does not fit the cell.
pub fn detect_setup(
    model: Option<&TwinFile>,
    cell: &Cell,
) -> Result<tauscope_detect::Setup, BuildError> {
    let correction = correction(model, cell)?;
    let constants = cell.facts.torque_constants_nm_per_a.as_deref();
    let joints = correction.joints.iter().enumerate().map(|(index, joint)| {
        // If friction exceeds the modelled effort, the fitted gain is not the ratio of current to torque.
        let effort_per_nm = match (cell.facts.effort_unit, constants) {
            (EffortUnit::Nm, _) => 1.0,
            (EffortUnit::A, Some(constants)) => 1.0 / constants[index],
            (EffortUnit::A, None) if joint.tells_torque() => joint.gain,
            (EffortUnit::A, None) => f64::NAN,
        };
        tauscope_detect::JointSetup {
            gain: joint.gain,
            offset: joint.offset,
            noise: joint.noise,
            effort_per_nm,
        }
    });
    let scores = model
        .into_iter()
        .flat_map(|model| &model.scores)
        .map(|(name, score)| {
            let score = tauscope_detect::ScoreStatistics {
                mean: score.mean,
                standard_deviation: score.standard_deviation,
            };
            (name.clone(), score)
        });
    Ok(tauscope_detect::Setup {
        cell: cell.facts.name.clone(),
        joints: joints.collect(),
        joint_names: cell.facts.joint_names.clone(),
        model: cell.model.clone(),
        scores: scores.collect(),
        tool_link: cell.tool_link(),
        contact_point_on_tool_m: cell.contact_point_on_tool_m(),
        impedance: cell.facts.impedance,
        trained: BTreeMap::new(),
        shared: None,
    })
}

/// Builds a watch over a twin of `cell` with this `model`. `effort_cutoff_hz` is the low-pass on the efforts of
/// joints that have none of their own in the model.
///
/// # Errors
/// If the model does not fit the cell.
pub fn watch(
    config: &watch::Config,
    model: Option<&TwinFile>,
    effort_cutoff_hz: f64,
    cell: &Cell,
) -> Result<Watch, BuildError> {
    let joints = detect_setup(model, cell)?.joints;
    let own = correction(model, cell)?.joints;
    let cutoffs = own.iter().map(|joint| joint.effort_cutoff_hz);
    let setup = watch::Setup {
        model: cell.model.clone(),
        effort_per_nm: joints.iter().map(|joint| joint.effort_per_nm).collect(),
        effort_cutoff_hz: cutoffs.map(|own| own.unwrap_or(effort_cutoff_hz)).collect(),
    };
    Ok(Watch::new(config, &setup))
}

/// Properties of a stream that a recorder needs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StreamFacts {
    /// The stage that emits it.
    pub stage: String,
    /// Its cell.
    pub cell: String,
    /// Sample type.
    pub kind: SampleKind,
    /// The detector, if it is a built-in one.
    pub detector: Option<String>,
    /// Whether its detections, if it emits any, are contacts.
    pub judges_contact: bool,
}

/// Builds a recorder of `streams`, which belong to `cells`.
///
/// # Errors
/// If cells, streams and file names are inconsistent, or a file cannot be created.
pub fn recorder(
    config: &tauscope_record::Config,
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

/// Builds a publisher of `streams` of one cell. `restarted` is set after its first start.
///
/// # Errors
/// If a network endpoint cannot be opened.
pub fn publisher(
    config: &tauscope_publish::Config,
    commands: Option<&ZenohEndpoints>,
    beside: &BesidePublisher,
    cell: &Cell,
    streams: &[StreamFacts],
    restarted: bool,
) -> Result<Publisher, PublishError> {
    let streams = streams.iter().map(|stream| tauscope_publish::StreamInfo {
        stage: stream.stage.clone(),
        kind: stream.kind,
        detector: stream.detector.clone(),
        judges_contact: stream.judges_contact,
    });
    let urdf = cell.facts.urdf.as_ref();
    let joints = cell.facts.joint_names.iter();
    let calibrated = joints.map(|name| beside.calibrated.get(name).copied());
    let setup = tauscope_publish::Setup {
        cell: cell.facts.name.clone(),
        joint_names: cell.facts.joint_names.clone(),
        model: cell.model.clone(),
        streams: streams.collect(),
        commands: commands.cloned(),
        facts: tauscope_publish::Facts {
            effort_unit: cell.facts.effort_unit.as_str().to_owned(),
            urdf_sha256: urdf.map(|urdf| sha256(urdf.as_bytes())),
            twin_sha256: beside.twin_sha256.clone(),
            calibrated: calibrated.collect(),
            archive: beside.archive.clone(),
        },
        restarted,
    };
    Publisher::new(config, &setup)
}
