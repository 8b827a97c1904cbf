//! From what the pipeline file says to stages that run: the same for `run`, `replay` and the check,
//! which builds every twin and detector to see whether it can be.

use tauscope_detect::Detect;
use tauscope_twin::{Correction, Twin, TwinFile};

use crate::pipeline::Cell;

/// Why a stage cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The twin's model does not fit the cell.
    #[error(transparent)]
    TwinFile(#[from] tauscope_twin::TwinFileError),
    /// The twin.
    #[error(transparent)]
    Twin(#[from] tauscope_twin::TwinError),
    /// The detector.
    #[error(transparent)]
    Detect(#[from] tauscope_detect::ConfigError),
}

/// What `model` corrects in `cell`; nothing without one.
pub fn correction(model: Option<&TwinFile>, cell: &Cell) -> Result<Correction, BuildError> {
    let joints = &cell.facts.joint_names;
    Ok(match model {
        Some(model) => model.resolve(joints, cell.facts.effort_unit.as_str())?,
        None => Correction::none(joints.len()),
    })
}

/// A twin of `cell`.
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
    Ok(Twin::new(config, setup, correction(model, cell)?)?)
}

/// A detector behind a twin of `cell` with this `model`.
pub fn detect(
    config: &tauscope_detect::Config,
    model: Option<&TwinFile>,
    cell: &Cell,
) -> Result<Detect, BuildError> {
    let correction = correction(model, cell)?;
    let constants = cell.facts.torque_constants_nm_per_a.as_deref();
    let joints = correction.joints.iter().enumerate().map(|(index, joint)| {
        let model_unit_per_nm = constants.map_or(1.0, |constants| 1.0 / constants[index]);
        tauscope_detect::JointSetup {
            gain: joint.gain,
            offset: joint.offset,
            noise: joint.noise,
            effort_per_nm: joint.gain * model_unit_per_nm,
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
    let setup = tauscope_detect::Setup {
        joints: joints.collect(),
        model: cell.model.clone(),
        scores: scores.collect(),
    };
    Ok(Detect::new(config, setup)?)
}
