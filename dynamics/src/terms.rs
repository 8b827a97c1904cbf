//! The physics that a rigid-body twin leaves out, each term written once: the twin adds it, the
//! simulated cell suffers it, an explanation fits it.
//!
//! A term is one file with an [`Effect`] that describes it and a [`Term`] that computes it; it is
//! known once it stands in [`EFFECTS`]. Names and parameters are canonical: files and reports hold
//! them. A fit does not search in the parameters but in [`Coordinate`]s in which the effort is as
//! linear as it can be, e.g. `A sin(q - q0)` by the factors of `sin q` and `cos q`.

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

/// Every effect there is.
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

/// The effect of that canonical name.
pub fn effect(name: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.name == name)
}

/// Over this speed the sign of a velocity is smoothed \[rad/s\].
/// Tuned: an order below the slowest motion that is compared; not swept.
pub const SIGN_SMOOTHING_RAD_S: f64 = 0.002;

/// The sign of a velocity \[rad/s\], smooth through standstill so that it has a value at rest and a
/// simulation can be integrated through a reversal: tanh(qd / 0.002 rad/s).
#[inline]
pub fn sign(velocity: f64) -> f64 {
    let x = velocity / SIGN_SMOOTHING_RAD_S;
    // Beyond this tanh is 1 in double precision.
    if x.abs() > 19.1 { x.signum() } else { x.tanh() }
}

/// Where a term is: indices into the model's joints and links. What the effect's [`PlaceKind`] does not
/// ask for is passed over.
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

/// One instant of a motion; slices hold one number per joint in URDF order.
#[derive(Debug, Clone, Copy)]
pub struct MotionSample<'a> {
    /// Time since the sample before \[s\]; 0 for the first and for a repeated stamp.
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
    /// Effort that the gears transmit, friction left out: the rigid body's with the [`Layer::Body`]
    /// terms \[N m or N\]. For terms of that layer the rigid body's alone.
    pub transmitted: &'a [f64],
}

impl MotionSample<'_> {
    /// Share of the sample that comes after a time, 0 to 1: a sample stands for the time from half a step before it to half
    /// a step behind it. `now_s` is its own time on the clock of `time_s`.
    #[must_use]
    pub fn share_after(&self, now_s: f64, time_s: f64) -> f64 {
        let since_s = now_s - time_s;
        // Times outside the sample need no division, and may be infinite.
        if since_s.abs() >= self.dt_s {
            return f64::from(u8::from(since_s >= 0.0));
        }
        (since_s / self.dt_s + 0.5).clamp(0.0, 1.0)
    }

    /// A number that changes from one value to another at a time of the session \[s\].
    #[must_use]
    pub fn stepped(&self, [before, after]: [f64; 2], time_s: f64) -> f64 {
        before + (after - before) * self.share_after(self.session_s, time_s)
    }
}

/// One piece of physics with its numbers, at one place of one robot.
///
/// What it does is told as effort of the motor: friction that holds a joint back by 4 N m costs
/// +4 N m while the joint moves forward. The torque on the joint is the opposite.
pub trait Term: std::fmt::Debug + Send {
    /// What it is.
    fn effect(&self) -> &'static Effect;

    /// Its coordinates, in the effect's order.
    fn coordinates(&self) -> &[f64];

    /// Forgets what came before: a new recording or a gap.
    fn reset(&mut self) {}

    /// Changes `effort` (per joint in URDF order) by what this term does at this instant, given all that
    /// came since the last [`Term::reset`]; to be called once per sample, in order. [`Layer::Record`]
    /// terms find the effort of all that came before them and transform it, others add to it. Does not
    /// allocate.
    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]);

    /// Takes what bodies cost along the motion that the following calls of [`Term::act`] go through, sample by sample
    /// and over any [`Term::reset`]: for terms that move a link by a little, which need not ask for it then.
    fn expand(&mut self, _along: &Arc<Expansion>) {}

    /// Takes what the robot that the term was built for costs along the motion that the following calls of
    /// [`Term::act`] go through, over any [`Term::reset`]: one effort per joint \[N m or N\] and sample, sample by sample.
    /// For terms that compare with it, which need not compute it then.
    fn know_recorded(&mut self, _efforts: &Arc<Vec<f64>>) {}

    /// Makes the change part of the model where it is one of rigid bodies or of gravity; `false` if it
    /// is not.
    fn alter(&self, _model: &mut Model) -> bool {
        false
    }

    /// The inertia that it adds at a link's frame for good, if that is what it is.
    fn inertia(&self) -> Option<(usize, Inertia)> {
        None
    }

    /// The inertia that it adds at a link's frame at this instant, for good or for a while, if that is what it is.
    fn inertia_at(&self, _at: &MotionSample<'_>) -> Option<(usize, Inertia)> {
        self.inertia()
    }

    /// The curve of an `unknown` effect: all there is to it.
    fn table(&self) -> Option<&Table> {
        None
    }
}
