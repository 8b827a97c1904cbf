//! The digital twin as a stage: it computes the effort that a robot's motion requires, and the residual of the
//! measured effort.
//!
//! The twin is the robot's rigid-body model, or a topic on which an external simulation publishes the effort. It is
//! corrected by a calibration on contact-free recordings: Tajiri and Iwamoto, "Collision Detection for Robot Arm
//! Assisted with Digital Twin System", equations 3 and 4.
//!
//! ```
//! use tauscope_bus::{Header, JointState, LinkError, Stage, TwinState};
//! use tauscope_dynamics::Model;
//! use tauscope_twin::{Config, Correction, Setup, Twin};
//!
//! /// Keeps the last sample that the stage puts out.
//! struct Last(TwinState);
//!
//! impl tauscope_bus::Emit<TwinState> for Last {
//!     fn emit(&mut self, fill: &mut dyn FnMut(&mut TwinState)) -> Result<(), LinkError> {
//!         fill(&mut self.0);
//!         Ok(())
//!     }
//! }
//!
//! let pendulum = r#"<robot name="pendulum">
//!   <link name="base"/>
//!   <link name="rod"><inertial>
//!     <origin xyz="0 0 -0.5"/><mass value="2"/>
//!     <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
//!   </inertial></link>
//!   <joint name="hinge" type="continuous">
//!     <parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
//!   </joint>
//! </robot>"#;
//! let setup = Setup {
//!     model: Some(Model::from_urdf(pendulum)?),
//!     joint_names: vec!["hinge".to_owned()],
//!     torque_constants_nm_per_a: None,
//!     tool_link: None,
//! };
//! let mut twin = Twin::new(&Config::default(), setup, Correction::none(1))?;
//! // Held level at rest by 10 N m.
//! let mut sample = JointState {
//!     header: Header { joint_count: 1, ..Header::default() },
//!     ..JointState::default()
//! };
//! sample.position[0] = std::f64::consts::FRAC_PI_2;
//! sample.effort[0] = 10.0;
//! let mut out = Last(TwinState::default());
//! twin.accept(&sample, &mut out)?;
//! // The motion requires m g l.
//! assert!((out.0.expected_effort[0] - 2.0 * 9.81 * 0.5).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calibration;
mod config;
mod motion;
mod plain_zeros;
mod stage;
mod twin_file;

pub use calibration::{Calibration, JointFit, spread_scale, telling_slopes, telling_slopes_of};
pub use config::{Config, Expected, Motion};
pub use stage::{Setup, Twin, TwinError};
pub use twin_file::{
    Correction, Filters, JointCorrection, Robot, ScoreStatistics, TWIN_FILE_VERSION, TwinFile,
    TwinFileError,
};
