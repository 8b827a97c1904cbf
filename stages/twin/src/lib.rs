//! What the effort should have been: a robot's digital twin computes the effort that the same motion
//! should have cost, and the residual of the measured effort against it.
//!
//! The twin is the robot's rigid-body model (or a topic, where somebody else's simulation computes
//! the effort), corrected by what a calibration learnt from contact-free recordings: Tajiri and
//! Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin System", equations 3 and 4.

mod calibration;
mod config;
mod motion;
mod stage;
mod twin_file;

pub use calibration::{Calibration, JointFit};
pub use config::{Config, Expected, Motion};
pub use stage::{Setup, Twin, TwinError};
pub use twin_file::{
    Correction, Filters, JointCorrection, Robot, ScoreStatistics, TWIN_FILE_VERSION, TwinFile,
    TwinFileError,
};
