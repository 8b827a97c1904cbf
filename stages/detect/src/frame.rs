//! The parts that all detectors share. The input is a twin's samples, the output a verdict for each:
//!
//! - [`detector`]: the trait of a detector: one score per sample, and optionally a verdict by its own rules.
//! - [`settings`]: the static properties of a detector: name, settings, construction and training.
//! - [`stage`]: a detector as a stage of the pipeline, with its [`threshold`], the start and end of an
//!   alarm ([`events`]), the loaded joints ([`loaded`]) and the touched link ([`isolation`]).
//! - [`here_or_file`]: a setting that may be kept in a file of its own.
//! - [`setup`]: the facts about the cell that a detector needs; [`lesson`]: its training data; [`trained`]: the file
//!   of trained weights; [`sweep`]: trade-off curves of the thresholds of a tuned detector.
//! - [`momentum`] and [`discriminant`]: methods that detectors of several papers use; [`shared`]: values common to
//!   the detectors of one stream, computed once; [`rate`] and [`joints`]: checks that learnt data fits this stream.
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
pub(crate) use events::DEFAULT_HOLD_S;
pub use here_or_file::HereOrFile;
pub use isolation::{Contact, Isolation};
pub(crate) use lesson::MATCH_BEFORE_NS;
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
