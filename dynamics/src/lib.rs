//! Model of the robot: URDF, kinematics, RNEA, regressor, and the physics that a rigid twin leaves out.
//!
//! A [`Model`] holds the constant description of a robot, [`Data`] the working memory and results of the algorithms.
//! The algorithms are free functions of both. None of them allocates. SI units throughout; joints are in the order of
//! the URDF's movable joints, and the world frame is that of the URDF's root link.
//!
//! The algorithms follow R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer 2008 ("RBDA"),
//! written out in three dimensions. They are generic over the number: `f64`, or [`Lanes`] for four samples at once.
//!
//! ```
//! use tauscope_dynamics::{Data, Model, rnea};
//!
//! let model = Model::from_urdf(
//!     r#"<robot name="pendulum">
//!          <link name="base"/>
//!          <link name="rod"><inertial>
//!            <origin xyz="0 0 -0.5"/><mass value="2"/>
//!            <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
//!          </inertial></link>
//!          <joint name="hinge" type="continuous">
//!            <parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
//!          </joint>
//!        </robot>"#,
//! )?;
//! let mut data = Data::new(&model);
//! // Held level at rest: m g l.
//! let effort = rnea(&model, &mut data, &[std::f64::consts::FRAC_PI_2], &[0.0], &[0.0]);
//! assert!((effort[0] - 2.0 * 9.81 * 0.5).abs() < 1e-12);
//! # Ok::<(), tauscope_dynamics::ModelError>(())
//! ```

#![cfg_attr(
    test,
    allow(clippy::float_cmp, reason = "tests compare what must be the same bits")
)]

mod aba;
mod crba;
mod data;
pub mod derivative;
pub mod effort_scale;
mod inertia;
mod inertial_effort;
pub mod kinematic_tree;
mod kinematics;
pub mod lowpass;
mod model;
mod motion_rows;
mod real;
mod regressor;
mod rnea;
mod rollout;
mod servo;
mod sines;
pub mod terms;
mod unwrap;

pub use aba::{Wrench, forward_dynamics};
pub use crba::mass_matrix;
pub use data::Data;
pub use inertia::{Inertia, PARAMETERS_PER_BODY};
pub use inertial_effort::InertialEffort;
pub use kinematics::{forward_kinematics, link_jacobian, link_pose, point_jacobian};
pub use model::{
    BodyFault, BodyFinding, BodyPlace, BodySeverity, Drive, Follower, Geometry, Joint, JointKind,
    Limits, Link, MUJOCO, Model, ModelError, Shape, Substitute, check_bodies, fix_joints,
    with_plausible_bodies,
};
pub use motion_rows::{gravity_rows, rnea_rows};
pub use real::{Lanes, Real};
pub use regressor::regressor;
pub use rnea::{gravity_effort, rnea};
pub use rollout::ClosedLoop;
pub use servo::{Commands, Feedforward, Observed, Servo};
pub use unwrap::Unwrap;
