//! The simulated cell: an arm with physics beyond its URDF, driven along given motions, pushed at
//! times, and measured by imperfect sensors.
//!
//! The effort is that of the motors: rigid-body effort plus friction and similar losses, minus the
//! effort of a push (measured - RNEA = friction - Jᵀ F, with F the force on the robot). Positions and
//! velocities are those of the motors. A scenario is deterministic: it gives the same numbers every time.

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
