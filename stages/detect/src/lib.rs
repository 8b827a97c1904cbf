//! Contacts and collisions from the residual. One detector, one file, in the folder of its paper: it
//! turns a twin's sample into a score, and the frame around all of them ([`Detect`]) does what they
//! share: the threshold, the beginning and end of an alarm, which joints and which link.
//!
//! A new detector is a file with a type that implements [`DetectorSettings`] and one that implements
//! [`Detector`], and one line in the table [`DETECTORS`].

pub mod config;
mod detectors;
pub mod frame;
pub mod indri;
pub mod salt_ducaju;
pub mod tajiri;
pub mod tauscope;

pub use config::{Config, StateFile};
pub use detectors::{DETECTORS, Entry};
pub use frame::{
    AnySettings, ConfigError, Contact, ContactKind, Details, Detect, Detector, DetectorSettings,
    Impedance, Isolation, JointSetup, Judgement, LabelledContact, LearnError, Lesson, Lessons,
    ScoreStatistics, Seen, Setup, Shared, State, Suits, Sweeps, Task, Threshold, Trained,
    TrainedError, Training, Verdict,
};
