//! Physics that a rigid-body twin leaves out. Each term is written once and used three times: the twin adds it, the
//! simulated cell applies it, and an explanation fits it.
//!
//! A term is one file with an [`Effect`] that describes it and a [`Term`] that computes it; it must be listed in
//! [`EFFECTS`]. Names and parameters are canonical: files and reports use them. A fit does not search in the
//! parameters but in [`Coordinate`]s in which the effort is as linear as possible, e.g. `A sin(q - q0)` by the
//! factors of `sin q` and `cos q`.

mod absent_tool;
mod asymmetric_coulomb;
mod backlash;
mod base_tilt;
mod base_tilt_in_recording;
mod bias_step;
mod cable_spring;
mod concealed;
mod contact_wall;
mod coulomb_friction;
mod counterbalance_spring;
mod creeping_friction;
mod delay_line;
mod displaced;
mod drive;
mod drive_deadband;
mod eccentric_gear;
mod effect;
mod encoder_eccentricity;
mod expansion;
mod export;
mod external_push;
mod friction_drift;
mod friction_step;
mod gain_drift;
mod gain_ripple;
mod gain_step;
mod gauge;
mod gear_efficiency;
mod ghost;
mod joint_elasticity;
mod joint_zero_offset;
mod joint_zero_offset_in_recording;
mod joint_zero_slip;
mod late_brake;
mod late_effort;
mod late_position;
mod law;
mod link_com;
mod link_inertia;
mod link_mass;
mod load_dependent_friction;
mod load_squared_friction;
mod payload;
mod payload_in_recording;
mod payload_in_session;
mod payload_pickup;
mod physics;
mod presliding_hysteresis;
mod quadratic_drag;
mod rotor_inertia;
mod sensor_hysteresis;
mod slow_clock;
mod spec;
mod split_joint;
mod stribeck_friction;
mod subtracted_friction;
mod table;
mod temperature_viscous;
#[cfg(test)]
mod tests;
mod torque_bias;
mod torque_delay;
mod torque_gain;
mod torque_lowpass;
mod torque_ripple;
mod torque_saturation;
mod transmission_coupling;
mod two_masses;
mod viscous_friction;
mod viscous_step;
mod wave;
pub mod words;

use std::sync::Arc;

use crate::{Inertia, Model};

pub use absent_tool::{EFFECT as ABSENT_TOOL, LEAST_ABSENT, share_of_carried};
pub use concealed::{Chance, Draw, Drawn, Parameters};
pub use coulomb_friction::EFFECT as COULOMB_FRICTION;
pub use drive::of_drives;
pub use effect::{
    Compliance, Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter,
    PlaceKind, Scale, Simpler, Simulated, Time, Traits,
};
pub use expansion::Expansion;
pub use export::{Exported, Quantity};
pub use gauge::Gauge;
pub use link_com::EFFECT as LINK_COM;
pub use payload::EFFECT as PAYLOAD;
pub use payload_pickup::EFFECT as PAYLOAD_PICKUP;
pub use physics::Physics;
pub use spec::{TermError, TermSpec};
pub use table::{Against, EFFECT as UNKNOWN, Table, TableSpec, table};
pub use torque_bias::EFFECT as TORQUE_BIAS;
pub use torque_gain::EFFECT as TORQUE_GAIN;
pub use viscous_friction::EFFECT as VISCOUS_FRICTION;
pub use words::Words;

/// All effects.
pub static EFFECTS: &[&Effect] = &[
    &viscous_friction::EFFECT,
    &coulomb_friction::EFFECT,
    &stribeck_friction::EFFECT,
    &asymmetric_coulomb::EFFECT,
    &load_dependent_friction::EFFECT,
    &load_squared_friction::EFFECT,
    &gear_efficiency::EFFECT,
    &eccentric_gear::EFFECT,
    &presliding_hysteresis::EFFECT,
    &creeping_friction::EFFECT,
    &quadratic_drag::EFFECT,
    &temperature_viscous::EFFECT,
    &friction_step::EFFECT,
    &viscous_step::EFFECT,
    &friction_drift::EFFECT,
    &late_brake::EFFECT,
    &subtracted_friction::EFFECT,
    &rotor_inertia::EFFECT,
    &torque_gain::EFFECT,
    &torque_bias::EFFECT,
    &bias_step::EFFECT,
    &transmission_coupling::EFFECT,
    &counterbalance_spring::EFFECT,
    &cable_spring::EFFECT,
    &torque_ripple::EFFECT,
    &payload::EFFECT,
    &absent_tool::EFFECT,
    &link_mass::EFFECT,
    &link_com::EFFECT,
    &link_inertia::EFFECT,
    &base_tilt::EFFECT,
    &base_tilt_in_recording::EFFECT,
    &joint_zero_offset::EFFECT,
    &joint_zero_offset_in_recording::EFFECT,
    &joint_zero_slip::EFFECT,
    &encoder_eccentricity::EFFECT,
    &gain_drift::EFFECT,
    &gain_step::EFFECT,
    &gain_ripple::EFFECT,
    &late_effort::EFFECT,
    &late_position::EFFECT,
    &slow_clock::EFFECT,
    &external_push::EFFECT,
    &contact_wall::EFFECT,
    &payload_pickup::EFFECT,
    &payload_in_recording::EFFECT,
    &payload_in_session::EFFECT,
    &torque_delay::EFFECT,
    &torque_lowpass::EFFECT,
    &torque_saturation::EFFECT,
    &drive_deadband::EFFECT,
    &sensor_hysteresis::EFFECT,
    &joint_elasticity::EFFECT,
    &backlash::EFFECT,
    &table::EFFECT,
];

/// The effect with this canonical name.
pub fn effect(name: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.name == name)
}

/// Speed below which a joint is at standstill: its friction takes any value up to breakaway \[rad/s or m/s\].
/// Chosen: half of the smallest Stribeck velocity that is searched, so that the fall of the friction is compared. A
/// slower motion is within the velocity noise of encoders.
pub const STANDSTILL_RAD_S: f64 = 0.01;
/// Speed over which the sign of a velocity is smoothed \[rad/s\].
/// Derived: a fifth of [`STANDSTILL_RAD_S`], so that the sign of a moving joint is 1 within 1e-4: tanh(5).
pub const SIGN_SMOOTHING_RAD_S: f64 = STANDSTILL_RAD_S / 5.0;

/// Smoothed sign of a velocity \[rad/s\]: tanh(qd / 0.002 rad/s). It has a value at rest, so a simulation can be
/// integrated through a reversal.
#[inline]
pub fn sign(velocity: f64) -> f64 {
    let x = velocity / SIGN_SMOOTHING_RAD_S;
    // Beyond this tanh is 1 in double precision.
    if x.abs() > 19.1 { x.signum() } else { x.tanh() }
}

/// Place of a term as indices into the model's joints and links. Indices that the effect's [`PlaceKind`] does not
/// need are ignored.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// The robot.
    pub model: &'a Model,
    /// The joint.
    pub joint: usize,
    /// The joint that drives it, for [`PlaceKind::TwoJoints`].
    pub source: usize,
    /// The link.
    pub link: usize,
}

/// One instant of a motion; slices hold one value per joint in URDF order.
#[derive(Debug, Clone, Copy)]
pub struct MotionSample<'a> {
    /// Time since the previous sample \[s\]; 0 for the first and for a repeated stamp.
    pub dt_s: f64,
    /// Time since the start of the recording \[s\].
    pub recording_s: f64,
    /// Time since the start of the session, the first recording \[s\].
    pub session_s: f64,
    /// Position \[rad or m\].
    pub position: &'a [f64],
    /// Velocity \[rad/s or m/s\].
    pub velocity: &'a [f64],
    /// Acceleration \[rad/s² or m/s²\].
    pub acceleration: &'a [f64],
    /// Effort that the gears transmit, without friction: that of the rigid body and the [`Layer::Body`] terms
    /// \[N m or N\]. For terms of that layer, the effort of the rigid body alone.
    pub transmitted: &'a [f64],
}

impl MotionSample<'_> {
    /// Share of the sample after a time, 0 to 1: a sample represents the interval from half a step before to half a
    /// step after it. `now_s` is its own time on the clock of `time_s`.
    #[must_use]
    pub fn share_after(&self, now_s: f64, time_s: f64) -> f64 {
        let since_s = now_s - time_s;
        // Times outside the sample need no division, and may be infinite.
        if since_s.abs() >= self.dt_s {
            return f64::from(u8::from(since_s >= 0.0));
        }
        (since_s / self.dt_s + 0.5).clamp(0.0, 1.0)
    }

    /// A value that changes from `before` to `after` at a time of the session \[s\].
    #[must_use]
    pub fn stepped(&self, [before, after]: [f64; 2], time_s: f64) -> f64 {
        before + (after - before) * self.share_after(self.session_s, time_s)
    }
}

/// An effect with its parameters, at one place of one robot.
///
/// Its effort is that of the motor: friction that resists with 4 N m needs +4 N m while the joint moves forward. The
/// torque on the joint has the opposite sign.
pub trait Term: std::fmt::Debug + Send {
    /// The effect.
    fn effect(&self) -> &'static Effect;

    /// Its coordinates, in the effect's order.
    fn coordinates(&self) -> &[f64];

    /// Clears the state before a new recording or after a gap.
    fn reset(&mut self) {}

    /// Changes `effort` (per joint in URDF order) by the effort of this term at this instant. The state depends on
    /// all samples since the last [`Term::reset`]; call once per sample, in order. [`Layer::Record`] terms receive
    /// the effort of all preceding terms and transform it, others add to it. Does not allocate.
    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]);

    /// Supplies the expansion of the bodies' effort along the motion of the following calls of [`Term::act`], sample
    /// by sample, across any [`Term::reset`]. Terms that deflect a link slightly then need no inverse dynamics.
    fn expand(&mut self, _along: &Arc<Expansion>) {}

    /// Supplies the effort of the robot that the term was built for along the motion of the following calls of
    /// [`Term::act`], across any [`Term::reset`]: one effort per joint \[N m or N\] and sample, sample by sample.
    /// Terms that compare with it then need not compute it.
    fn know_recorded(&mut self, _efforts: &Arc<Vec<f64>>) {}

    /// Applies the change to the model if it concerns rigid bodies or gravity; `false` otherwise.
    fn alter(&self, _model: &mut Model) -> bool {
        false
    }

    /// Inertia that the term adds permanently at a link's frame, if any.
    fn inertia(&self) -> Option<(usize, Inertia)> {
        None
    }

    /// Inertia that the term adds at a link's frame at this instant, permanently or temporarily, if any.
    fn inertia_at(&self, _at: &MotionSample<'_>) -> Option<(usize, Inertia)> {
        self.inertia()
    }

    /// The curve of an `unknown` effect, which has no other parameters.
    fn table(&self) -> Option<&Table> {
        None
    }
}
