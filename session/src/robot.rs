//! A robot file, read and checked: the one way in which commands open a robot.

mod mjcf;

use std::path::Path;

use tauscope_archive::file_kind;
use tauscope_dynamics::{
    BodyFinding, BodySeverity, Model, ModelError, check_bodies, with_plausible_bodies,
};

pub use mjcf::MjcfError;

/// A robot, and what is odd or wrong about its file.
#[derive(Debug, Clone)]
pub struct Robot {
    /// The URDF; impossible inertias are replaced by those of uniform bodies.
    pub urdf: String,
    /// The robot of that URDF.
    pub model: Model,
    /// Findings about its bodies, a sentence each.
    pub findings: Vec<String>,
}

/// Why there is no robot.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The file cannot be read as text.
    #[error("cannot read the URDF: {0}")]
    Unreadable(String),
    /// It is no robot that the algorithms can work on.
    #[error("cannot use the URDF: {0}")]
    Unusable(#[from] ModelError),
    /// It is a MuJoCo model that cannot be used.
    #[error("{0}")]
    Mjcf(#[from] MjcfError),
}

/// Outermost element of a MuJoCo model.
const MJCF_ROOT: &str = "mujoco";
/// Longest file \[bytes\].
/// Resolution: bounds memory.
const MAX_BYTES: u64 = 16 << 20;

/// The robot at `path`, a URDF or a MuJoCo model, with the findings about its file.
///
/// # Errors
/// If there is no such file, it is of another kind, or the robot cannot be used.
pub fn read(path: &Path) -> Result<Robot, UrdfError> {
    let large = std::fs::metadata(path).map_or(0, |file| file.len());
    if large > MAX_BYTES {
        let path = path.display();
        let title = format!("{path} has {large} bytes, the limit is {MAX_BYTES}");
        return Err(UrdfError::Unreadable(title));
    }
    let text = std::fs::read_to_string(path).map_err(|error| {
        let kind = file_kind(path);
        UrdfError::Unreadable(match (error.kind(), kind) {
            (std::io::ErrorKind::NotFound, _) => format!("there is no file {}", path.display()),
            (_, Some(kind)) => format!("{} is {kind}", path.display()),
            (_, None) => format!("{}: {error}", path.display()),
        })
    })?;
    // Faults of links and joints are reported before those of bodies.
    let (text, model, remarks) = match Model::from_urdf(&text) {
        Err(ModelError::NotARobot { found, .. }) if found == MJCF_ROOT => {
            let (urdf, remarks) = mjcf::to_urdf(&text, path)?;
            let model = Model::from_urdf(&urdf)?;
            (urdf, model, remarks)
        }
        model => (text, model?, Vec::new()),
    };
    let findings = check_bodies(&text)?;
    let sentences = findings.iter().map(ToString::to_string);
    let sentences = remarks.into_iter().chain(sentences);
    let sentences = sentences.map(|sentence| format!("{}: {sentence}", path.display()));
    let is_impossible = |finding: &BodyFinding| finding.severity == BodySeverity::Impossible;
    let (urdf, model) = if findings.iter().any(is_impossible) {
        let urdf = with_plausible_bodies(&text, &findings)?;
        let model = Model::from_urdf(&urdf)?;
        (urdf, model)
    } else {
        (text, model)
    };
    Ok(Robot {
        urdf,
        model,
        findings: sentences.collect(),
    })
}
