//! What all detectors share.

pub(crate) mod detector;
mod events;
pub(crate) mod isolation;
pub(crate) mod joints;
pub(crate) mod lesson;
pub mod momentum;
pub(crate) mod rate;
pub(crate) mod shared;
pub(crate) mod stage;
