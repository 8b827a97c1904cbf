//! Contacts and collisions from the residual. One detector, one file: it turns a twin's sample into a
//! score, and the frame around all of them ([`Detect`]) does what they share: the threshold, the
//! beginning and end of an alarm, which joints and which link.
//!
//! A new detector is a file with a type that implements [`Detector`] and a `Settings` for the
//! pipeline file, and one line in [`config`].

pub mod config;
pub mod contact_classifier;
pub mod contact_machine;
pub mod contact_signals;
pub mod contact_tuning;
mod detector;
mod events;
pub mod fisher_discriminant;
pub mod frequency_classifier;
mod isolation;
mod joints;
pub mod learned;
mod lesson;
pub mod lstm_momentum_observer;
pub mod momentum;
pub mod momentum_observer;
pub mod naive_difference;
pub mod point_autoencoder;
pub mod point_ocsvm;
mod rate;
mod shared;
pub mod sliding_dft;
mod stage;
pub mod tauscope;
pub mod twin_regression;
pub mod virtual_collision_sensor;
pub mod virtual_collision_sensor_basic;
pub mod window_autoencoder;
pub mod window_ocsvm;
pub mod wrench;

pub use config::{Config, ConfigError, Threshold};
pub use detector::{Details, Detector, Judgement, Seen, Verdict};
pub use isolation::{Contact, Isolation};
pub use learned::{Trained, TrainedError};
pub use lesson::{ContactKind, LabelledContact, LearnError, Lesson, Lessons};
pub use shared::Shared;
pub use stage::{Detect, Impedance, JointSetup, ScoreStatistics, Setup};
