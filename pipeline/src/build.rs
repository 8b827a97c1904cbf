//! Builds twins, detectors and watches from their settings, in the same way for `run`, `replay`, `calibrate`,
//! `evaluate` and the check, which builds each of them to validate its settings.

use std::collections::BTreeMap;

use tauscope_detect::Detect;
use tauscope_twin::{Correction, Expected, Twin, TwinFile};
use tauscope_watch::{self as watch, Watch};

use crate::cell::{Cell, EffortUnit};
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
