//! Detection of contacts and collisions from the residual. Each detector is one file in the folder of its
//! paper and turns a twin's sample into a score. The stage around it ([`Detect`]) does what all detectors
//! share: the threshold, the start and end of an alarm, the loaded joints and the touched link.
//!
//! ```
//! use tauscope_bus::{Detection, Emit, LinkError, Stage as _, TwinState, flags};
//! use tauscope_detect::tajiri::twin_regression;
//! use tauscope_detect::{Config, JointSetup, Setup, Threshold};
//!
//! /// Prints the start of each alarm.
//! struct Onsets;
//! impl Emit<Detection> for Onsets {
//!     fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
//!         let mut detection = Detection::default();
//!         write(&mut detection);
//!         if detection.event == Detection::ONSET {
//!             println!("contact at {} ns, score {}", detection.contact_ns, detection.score);
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let joint = JointSetup { gain: 1.0, offset: 0.0, noise: Some(0.1), effort_per_nm: 1.0 };
//! let cell = Setup { joints: vec![joint; 2], ..Setup::default() };
//! // The alarm is raised when the squared length of the residual reaches 4 (N m)².
//! let config = Config {
//!     threshold: Threshold { score: Some(4.0), sigmas: None },
//!     ..Config::of(twin_regression::Settings::default())
//! };
//! let mut stage = config.stage(cell)?;
//! let mut sample = TwinState::default();
//! sample.header.joint_count = 2;
//! sample.header.flags = flags::READY;
//! for step in 0..100 {
//!     sample.header.stamp_ns = step * 10_000_000;
//!     // A contact loads joint 1 from the 50th sample on.
//!     sample.residual[0] = if step < 50 { 0.0 } else { -3.0 };
//!     stage.accept(&sample, &mut Onsets)?;
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
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
    HereOrFile, Impedance, Isolation, JointSetup, Judgement, LabelledContact, LearnError, Lesson,
    Lessons, ScoreStatistics, ScoreUnit, Seen, Setup, Shared, State, Suits, Sweeps, Task,
    Threshold, Trained, TrainedError, Training, Verdict,
};
