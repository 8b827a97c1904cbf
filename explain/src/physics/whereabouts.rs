//! The place of an effect.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::Site;

/// Place of an effect: indices into the model's joints and links. Indices that its kind of place does not use are 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Whereabouts {
    /// The joint.
    pub joint: usize,
    /// The joint whose effort is coupled into it.
    pub source: usize,
    /// The link.
    pub link: usize,
}

impl Whereabouts {
    /// Returns the place in a robot.
    pub fn site(self, model: &Model) -> Site<'_> {
        let Self {
            joint,
            source,
            link,
        } = self;
        Site {
            model,
            joint,
            source,
            link,
        }
    }
}
