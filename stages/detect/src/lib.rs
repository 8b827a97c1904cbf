//! Contacts and collisions from the residual. One detector, one file, in the folder of its paper: it
//! turns a twin's sample into a score, and the frame around all of them ([`Detect`]) does what they
//! share: the threshold, the beginning and end of an alarm, which joints and which link.

pub mod config;
pub mod frame;
pub mod indri;
pub mod salt_ducaju;
pub mod tajiri;
pub mod tauscope;

pub use config::{Config, ConfigError, Threshold};
pub use frame::detector::{Details, Detector, Judgement, Seen, Verdict};
pub use frame::isolation::{Contact, Isolation};
pub use frame::lesson::{ContactKind, LabelledContact, LearnError, Lesson, Lessons};
pub use frame::shared::Shared;
pub use frame::stage::{Detect, Impedance, JointSetup, ScoreStatistics, Setup};
pub use tajiri::learned::{Trained, TrainedError};
