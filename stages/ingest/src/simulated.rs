//! The simulated cell: an arm with physics that its URDF does not tell of, driven along given motions,
//! pushed now and then, and measured by imperfect sensors.
//!
//! Effort is the motor's: what the rigid body needs, plus what friction and the like cost, less what
//! a push does for it (measured - RNEA = friction - Jᵀ F, with F the force on the robot). The same
//! scenario gives the same numbers every time. Positions and velocities are those of the motors.

mod check;
mod conceal;
mod controller;
mod error;
mod inverse;
mod labels;
mod link_point;
mod messages;
mod obstacle;
mod plan;
mod plant;
mod push;
mod record;
mod scenario;
mod sensors;
mod simulation;
mod source;
mod trajectory;
mod write;

pub use conceal::{ConcealSpec, Concealed, ConcealedEffect, fit_count};
pub use error::ScenarioError;
pub use labels::Labels;
pub use scenario::{
    BoxSpec, ContactKind, ContactSpec, ControllerSettings, Damps, EffortUnit, FourierSpec,
    HandsSpec, ImpedanceSpec, LabelSpec, MotionSpec, ObstacleSpec, PlaneSpec, PointsSpec, Profile,
    ReachSpec, RecordedMotionSpec, RecordingSpec, Role, Scenario, Sensors, SphereSpec, ToolSpec,
    WithinSpec,
};
pub use simulation::{Event, Reading, Simulation};
pub use source::SimulatedCell;
pub use write::{Simulated, simulate};

#[cfg(test)]
mod tests;
