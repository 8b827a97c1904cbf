//! Export of corrections into a simulator's own file.
//!
//! A twin's terms become [`Corrections`]: quantities of joints and bodies. A [`Target`] maps each quantity to an
//! element of its simulator, if there is one. The writers change these elements of the user's file and nothing else.

mod corrections;
mod edits;
mod isaac_lab;
mod mjcf;
mod sdf;
mod table;
mod target;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod tests;
mod urdf;

pub use corrections::{Corrections, JointCorrections};
pub use table::table;
pub use target::{Place, TARGETS, Target};

/// The reason why a model cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file is not well-formed XML.
    #[error("the model is not well-formed XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// The file is of another kind than the target.
    #[error(
        "the model is a <{found}>, and {target} needs a <{expected}>: give the file with --model FILE"
    )]
    OtherKind {
        /// The outermost element of the file.
        found: String,
        /// The target's name.
        target: &'static str,
        /// The outermost element that the target needs.
        expected: &'static str,
    },
    /// The file lacks a joint or a link.
    #[error("the model has no {kind} `{name}`")]
    Missing {
        /// `joint`, `link` or `body`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// A link would get a mass or inertia that no rigid body has.
    #[error(
        "{kind} `{name}` would get a mass or an inertia that no rigid body has: some of its parameters are too uncertain in this data"
    )]
    NoBody {
        /// `link` or `body`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
}

/// A file for a simulator.
#[derive(Debug)]
pub struct Written {
    /// Its text.
    pub text: String,
    /// Quantities that were written, a line each.
    pub written: Vec<String>,
    /// Effects that were approximated or left out, with the reason, a line each.
    pub lost: Vec<String>,
}

/// Writes the corrections into the simulator's file `source` (empty for a target that needs none). `urdf` is the
/// robot as the twin reads it.
///
/// # Errors
/// If the file is not one of that simulator, or lacks a joint or link to be corrected.
pub fn write(
    target: Target,
    source: &str,
    urdf: &str,
    corrections: &Corrections,
) -> Result<Written, ModelError> {
    let text = match target {
        Target::Urdf | Target::Drake => urdf::corrected(target, source, corrections)?,
        Target::Mjcf => mjcf::corrected(source, urdf, corrections)?,
        Target::Sdf => sdf::corrected(source, corrections)?,
        Target::IsaacLab => isaac_lab::configuration(corrections),
    };
    let (written, mut lost) = target.said(corrections);
    lost.extend(corrections.lost.iter().cloned());
    Ok(Written {
        text: target.with_comment(&text, &written, &lost),
        written,
        lost,
    })
}
