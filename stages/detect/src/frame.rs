//! What all detectors share. In go a twin's samples, out comes a verdict for each:
//!
//! - [`detector`]: what a detector is: a score a sample, perhaps a verdict of its own.
//! - [`settings`]: what a detector tells of itself: name, settings, how it is built and how it learns.
//! - [`stage`]: a detector as a stage of the pipeline, with its [`threshold`], the beginning and end of an
//!   alarm ([`events`]), the loaded joints ([`loaded`]) and the touched link ([`isolation`]).
//! - [`here_or_file`]: a setting that may stand in a file of its own.
//! - [`setup`]: what a detector must know of its cell; [`lesson`]: what it learns from; [`trained`]: the file of
//!   trained weights; [`sweep`]: what the thresholds of a tuned detector trade against each other.
//! - [`momentum`] and [`discriminant`]: methods that detectors of several papers use; [`shared`]: what detectors of
//!   one stream derive alike, derived once; [`rate`] and [`joints`]: whether what was learnt belongs to this stream.
//!
//! The threshold is equation 7 of Tajiri and Iwamoto, the isolation sections V and VI of Haddadin, De Luca and
//! Albu-Schäffer, "Robot Collisions: A Survey on Detection, Isolation, and Identification", 2017.

mod detector;
mod discriminant;
mod error;
mod events;
mod here_or_file;
mod isolation;
pub(crate) mod joints;
mod lesson;
mod loaded;
pub mod momentum;
pub(crate) mod rate;
mod settings;
mod setup;
mod shared;
mod stage;
mod sweep;
mod threshold;
mod trained;

pub use detector::{Details, Detector, Judgement, Seen, State, Verdict};
pub use discriminant::Discriminant;
pub(crate) use discriminant::Moments;
pub use error::ConfigError;
pub use here_or_file::HereOrFile;
pub use isolation::{Contact, Isolation};
pub use lesson::{ContactKind, LabelledContact, LearnError, Lesson, Lessons, Task};
pub(crate) use loaded::LoadedJoints;
pub use settings::{AnySettings, DetectorSettings, ScoreUnit, Suits, Training};
pub use setup::{Impedance, JointSetup, Setup};
pub use shared::Shared;
pub(crate) use shared::Tap;
pub use stage::Detect;
pub use sweep::{ClassSweep, FoundSweep, Sweeps, ThresholdSweep};
pub use threshold::Threshold;
pub use trained::{Facts, ScoreStatistics, SignalSettings, Trained, TrainedError};
