//! A robot file, read and checked: the one way in which commands open a robot.

mod mjcf;

use std::path::Path;

use tauscope_archive::file_kind;
use tauscope_dynamics::{
    BodyFinding, BodySeverity, Drive, Model, ModelError, check_bodies, with_plausible_bodies,
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
    let text = text_of(path)?;
    // Faults of links and joints are reported before those of bodies.
    let (text, remarks) = if is_mjcf(&text) {
        mjcf::to_urdf(&text, path)?
    } else {
        (text, Vec::new())
    };
    let model = Model::from_urdf(&text)?;
    let remarks = remarks.into_iter().chain(of_drives(&text, &model));
    let findings = check_bodies(&text)?;
    let sentences = findings.iter().map(ToString::to_string);
    let sentences = remarks.chain(sentences);
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

fn text_of(path: &Path) -> Result<String, UrdfError> {
    let large = std::fs::metadata(path).map_or(0, |file| file.len());
    if large > MAX_BYTES {
        let path = path.display();
        let title = format!("{path} has {large} bytes, the limit is {MAX_BYTES}");
        return Err(UrdfError::Unreadable(title));
    }
    std::fs::read_to_string(path).map_err(|error| {
        let kind = file_kind(path);
        UrdfError::Unreadable(match (error.kind(), kind) {
            (std::io::ErrorKind::NotFound, _) => format!("there is no file {}", path.display()),
            (_, Some(kind)) => format!("{} is {kind}", path.display()),
            (_, None) => format!("{}: {error}", path.display()),
        })
    })
}

/// A robot file as it is written, for corrections at its places.
#[derive(Debug, Clone)]
pub enum Source {
    /// A URDF.
    Urdf(String),
    /// A MuJoCo model, with the files that it includes in place of their `<include>`s.
    Mjcf(String),
}

/// The robot file at `path` as it is written.
///
/// # Errors
/// If it cannot be read, or a file that it includes.
pub fn source(path: &Path) -> Result<Source, UrdfError> {
    let text = text_of(path)?;
    if is_mjcf(&text) {
        Ok(Source::Mjcf(mjcf::whole(&text, path)?))
    } else {
        Ok(Source::Urdf(text))
    }
}

/// The URDF of a MuJoCo model without the elements of MuJoCo's namespace, for readers of URDF.
///
/// # Errors
/// If what is left is no robot.
pub fn plain_urdf(urdf: &str) -> Result<(String, Model), ModelError> {
    let text = mjcf::without_mujoco(urdf);
    let model = Model::from_urdf(&text)?;
    Ok((text, model))
}

fn is_mjcf(text: &str) -> bool {
    let found = Model::from_urdf(text).err();
    matches!(found, Some(ModelError::NotARobot { found, .. }) if found == MJCF_ROOT)
}

/// Sentences about friction, rotors and springs in the file.
fn of_drives(urdf: &str, model: &Model) -> Vec<String> {
    let mut said = Vec::new();
    let joints = model.joints().iter();
    let stated = joints
        .filter(|joint| joint.drive != Drive::default())
        .count();
    if stated > 0 {
        said.push(format!(
            "it states friction, rotors or springs of {stated} joints. They are part of the twin, and findings add to them"
        ));
    }
    let size = |node: &roxmltree::Node<'_, '_>| {
        let number = |name| {
            node.attribute(name)
                .and_then(|text| text.parse::<f64>().ok())
        };
        let all = ["damping", "friction"].into_iter().filter_map(number);
        all.fold(0.0_f64, |most, x| most.max(x.abs()))
    };
    // The text has been read as a robot.
    let document = roxmltree::Document::parse(urdf);
    let dynamics = document.iter().flat_map(roxmltree::Document::descendants);
    let dynamics = dynamics.filter(|node| node.has_tag_name("dynamics") && size(node) > 0.0);
    let count = dynamics.count();
    if count > 0 {
        said.push(format!(
            "the <dynamics> of {count} joints is no part of the twin, because exporters write placeholders there. Friction in findings is \
             the whole friction"
        ));
    }
    said
}
