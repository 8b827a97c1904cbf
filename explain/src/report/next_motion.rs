//! The motion that would separate effects that this data cannot tell apart: as text, and as a trajectory within the URDF's
//! limits.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use tauscope_dynamics::terms::{Effect, Excitation, PlaceKind};
use tauscope_dynamics::{JointKind, Model};

use crate::physics::active::Hypothesis;
use crate::read::input::Input;
use crate::report::schema::{NextMotion, Rival};

/// How the name of a file with a motion to record next begins.
pub const MOTION_PREFIX: &str = "next_";

/// Share of a joint's range that a trajectory uses.
/// Tuned: by hand, on no recorded seeds; not swept.
const RANGE: f64 = 0.8;
/// Share of a joint's speed limit that a trajectory uses.
/// Tuned: by hand, on no recorded seeds; not swept.
const SPEED: f64 = 0.7;
/// Half the range of a joint without position limits in the URDF \[rad or m\].
/// Tuned: by hand, on no recorded seeds; not swept.
const DEFAULT_HALF_RANGE: f64 = 1.5;
/// Speed limit of a joint without one in the URDF \[rad/s or m/s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const DEFAULT_SPEED: f64 = 1.0;
/// Highest acceleration \[rad/s² or m/s²\].
/// Tuned: by hand, on no recorded seeds; not swept.
const ACCELERATION: f64 = 4.0;
/// How long a part of a trajectory lasts \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const PART_S: f64 = 20.0;
/// Time between two rows of a trajectory \[s\].
/// Resolution: 100 rows per second; changes the file's size.
const STEP_S: f64 = 0.01;
/// The slowest speed of a creeping joint \[rad/s or m/s\].
/// Physical: twice what counts as standstill, and well below usual Stribeck velocities.
const CREEP: f64 = 0.02;
/// How many speeds a creeping joint has.
/// Tuned: by hand, on no recorded seeds; not swept.
const SPEEDS: usize = 5;
/// Each of these speeds over the one before.
/// Tuned: by hand, on no recorded seeds; not swept.
const FASTER: f64 = 2.2;
/// How long a creeping joint takes to reach its speed, and to stop \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const RAMP_S: f64 = 0.3;
/// How long the other motions take to fade in, and to fade out \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const FADE_S: f64 = 2.0;
/// Share of the largest possible swing that a wave has.
/// Tuned: by hand, on no recorded seeds; not swept.
const SWING: f64 = 0.8;
/// Highest frequency of a motion over the whole range \[Hz\].
/// Tuned: by hand, on no recorded seeds; not swept.
const WHOLE_RANGE_HZ: f64 = 0.1;
/// Share of the swing, frequency \[Hz\], and how much more of it each further joint has \[Hz\], of fast reversals.
/// Tuned: by hand, on no recorded seeds; not swept.
const FAST: [Wave; 3] = [[0.3, 0.4, 0.13], [0.3, 1.5, 0.29], [0.4, 4.3, 0.37]];
/// The same for a joint at all speeds.
/// Tuned: by hand, on no recorded seeds; not swept.
const ALL_SPEEDS: [Wave; 2] = [[0.6, 0.15, 0.0], [0.4, 1.1, 0.0]];
/// The same for the other joints meanwhile.
/// Tuned: by hand, on no recorded seeds; not swept.
const OTHER_JOINTS: [Wave; 1] = [[0.5, 0.11, 0.03]];
/// The same for all poses.
/// Tuned: by hand, on no recorded seeds; not swept.
const ALL_POSES: [Wave; 2] = [[0.7, 0.1, 0.037], [0.3, 0.6, 0.11]];

/// A sine: share of the swing, frequency \[Hz\], and how much more of it each further joint has \[Hz\].
type Wave = [f64; 3];

/// What a motion must excite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Excite {
    /// The whole range of one joint, slowly: springs and other functions of position.
    WholeRange,
    /// Fast reversals: delays and rotors.
    Fast,
    /// One joint at constant speeds from creeping on, in both directions: kinds of friction near standstill.
    Creep,
    /// Every speed in both directions, with reversals: kinds of friction.
    AllSpeeds,
    /// Gravity from all sides: masses, centres of mass and gains.
    AllPoses,
}

impl Excite {
    /// The motions that tell two effects apart.
    fn of(winner: &Effect, rival: &Effect) -> &'static [Self] {
        match winner.excitation.between(rival.excitation) {
            Excitation::Fast => &[Self::Fast],
            Excitation::Poses => &[Self::AllPoses],
            Excitation::WholeRange => &[Self::WholeRange],
            Excitation::Speeds => &[Self::Creep, Self::AllSpeeds],
        }
    }

    /// The motions that tell `winner` from each of its rivals.
    fn of_class(winner: &Hypothesis, ties: &[Hypothesis]) -> Vec<Self> {
        let mut parts = Vec::new();
        for rival in ties {
            for part in Self::of(winner.effect, rival.effect) {
                if !parts.contains(part) {
                    parts.push(*part);
                }
            }
        }
        parts
    }

    fn words(self, joint: &str) -> String {
        match self {
            Self::WholeRange => format!(
                "Move joint {joint} slowly over its whole range, there and back, with the other joints at rest. A spring, a \
                 counterbalance and a gain differ clearly over more than 60 degrees."
            ),
            Self::Fast => "Move all joints fast, with reversals at rising frequency. The phase of a delay grows with frequency, a \
                           low-pass lowers the amplitude, and an elastic joint resonates."
                .to_owned(),
            Self::Creep => format!(
                "Move joint {joint} there and back at constant speeds, starting very slowly. Some kinds of friction differ only \
                 below a few degrees per second."
            ),
            Self::AllSpeeds => format!(
                "Move joint {joint} at all speeds, in both directions, with many reversals and in several poses of the arm. \
                 Kinds of friction depend differently on speed, direction and load."
            ),
            Self::AllPoses => "Turn the last joints through their whole ranges, with accelerations and in several poses of the arm. A \
                               payload, a link's mass and its centre of mass load the joints differently in each pose, and a gain \
                               shows where the effort is large."
                .to_owned(),
        }
    }
}

/// The motion to record next for a finding with rivals that tie, and its trajectory as CSV text.
pub fn of(
    winner: &Hypothesis,
    ties: &[Hypothesis],
    input: &Input,
    joints: &[String],
) -> Option<(NextMotion, String)> {
    let rival = |h: &Hypothesis| Rival {
        effect: h.effect.name.to_owned(),
        joint: matches!(h.effect.place, PlaceKind::Joint | PlaceKind::TwoJoints)
            .then(|| joints[h.place.joint].clone()),
        link: matches!(h.effect.place, PlaceKind::Link | PlaceKind::Tool)
            .then(|| input.model.links()[h.place.link].name.clone()),
    };
    let parts = Excite::of_class(winner, ties);
    if parts.is_empty() {
        return None;
    }
    let joint = winner.place.joint;
    let place = winner.only_joint().map_or("all", |j| joints[j].as_str());
    let motion = NextMotion {
        separates: std::iter::once(winner).chain(ties).map(rival).collect(),
        sentence: (parts.iter().map(|part| part.words(&joints[joint])))
            .collect::<Vec<_>>()
            .join(" "),
        trajectory: Some(format!("{MOTION_PREFIX}{}_{place}.csv", winner.effect.name)),
    };
    let centre = centre_of(input);
    Some((motion, csv(&input.model, &parts, joint, &centre)))
}

/// The middle of each joint's recorded range, which is known to be free of obstacles.
fn centre_of(input: &Input) -> Vec<f64> {
    let n = input.model.dof();
    (0..n)
        .map(|j| {
            let all = input
                .fit
                .iter()
                .flat_map(|r| r.position.iter().skip(j).step_by(n));
            let (low, high) = all.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
            if low <= high { 0.5 * (low + high) } else { 0.0 }
        })
        .collect()
}

/// Header `t,` and the joints' names; positions \[rad or m\], one part after the other.
fn csv(model: &Model, parts: &[Excite], joint: usize, centre: &[f64]) -> String {
    let mut text = String::from("t");
    for name in model.joint_names() {
        let _ = write!(text, ",{name}");
    }
    text.push('\n');
    let steps = (PART_S / STEP_S) as usize;
    for (at, part) in parts.iter().enumerate() {
        // Each ends where the next begins.
        let last = at + 1 == parts.len();
        for k in 0..steps + usize::from(last) {
            let t = k as f64 * STEP_S;
            let _ = write!(text, "{:.3}", at as f64 * PART_S + t);
            for j in 0..model.dof() {
                let _ = write!(text, ",{:.6}", position(model, *part, joint, centre, j, t));
            }
            text.push('\n');
        }
    }
    text
}

/// Distance at time `t` from the start of a joint that creeps there and back at one speed after the other. Each speed is
/// limited so that the joint stays within `room`.
fn crept(room: f64, speed: f64, t: f64) -> f64 {
    let stroke_s = PART_S / (2 * SPEEDS) as f64;
    let stroke = (t / stroke_s) as i32;
    let speed = (CREEP * FASTER.powi(stroke / 2))
        .min(speed)
        .min(room / (stroke_s - RAMP_S));
    // Distance of a trapezoidal speed profile with ramps of RAMP_S.
    let within = t - f64::from(stroke) * stroke_s;
    let coming = within.min(RAMP_S);
    let going = (within - (stroke_s - RAMP_S)).max(0.0);
    let way =
        speed * (within - coming + 0.5 * coming * coming / RAMP_S - 0.5 * going * going / RAMP_S);
    if stroke % 2 == 0 {
        way
    } else {
        speed * (stroke_s - RAMP_S) - way
    }
}

/// Position of joint `j` at time `t` of a motion about `centre`, within the limits, from rest to rest.
fn position(model: &Model, excite: Excite, joint: usize, centre: &[f64], j: usize, t: f64) -> f64 {
    let limits = &model.joints()[j].limits;
    let (lower, upper) = match (limits.lower, limits.upper) {
        (Some(lower), Some(upper)) if model.joints()[j].kind != JointKind::Continuous => {
            (lower, upper)
        }
        _ => (
            centre[j] - DEFAULT_HALF_RANGE,
            centre[j] + DEFAULT_HALF_RANGE,
        ),
    };
    let middle = centre[j].clamp(lower, upper);
    let room = RANGE * (upper - middle).min(middle - lower).max(0.0);
    let speed = SPEED * limits.velocity.unwrap_or(DEFAULT_SPEED);
    // Fades in and out, so that it begins and ends at rest.
    let fade = |t: f64| (t / FADE_S).min((PART_S - t) / FADE_S).clamp(0.0, 1.0);
    let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
    // The largest swing of this frequency that speed, acceleration and range allow.
    let swing = |hz: f64| {
        let omega = TAU * hz;
        room.min(speed / omega).min(ACCELERATION / (omega * omega))
    };
    let wave = |hz: f64| SWING * swing(hz) * (TAU * hz * t).sin();
    let sum = |waves: &[Wave]| -> f64 {
        let one = |[share, hz, further]: &Wave| share * wave(hz + further * j as f64);
        waves.iter().map(one).sum()
    };
    let own = j == joint;
    let move_by = match excite {
        Excite::WholeRange if own => {
            let hz = (speed / (TAU * room.max(1e-6))).min(WHOLE_RANGE_HZ);
            room.min(swing(hz)) * (TAU * hz * t).sin()
        }
        Excite::Creep if own => return middle + crept(room, speed, t),
        Excite::WholeRange | Excite::Creep => 0.0,
        Excite::Fast => sum(&FAST),
        Excite::AllSpeeds if own => sum(&ALL_SPEEDS),
        Excite::AllSpeeds => sum(&OTHER_JOINTS),
        Excite::AllPoses => sum(&ALL_POSES),
    };
    middle + smooth(fade(t)) * move_by
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;

    #[test]
    fn trajectories_keep_within_the_limits() {
        let urdf = include_str!("../../../tests/data/demo_arm.urdf");
        let model = Model::from_urdf(urdf).unwrap();
        let centre = vec![0.0; model.dof()];
        for excite in [
            Excite::WholeRange,
            Excite::Fast,
            Excite::Creep,
            Excite::AllSpeeds,
            Excite::AllPoses,
        ] {
            for j in 0..model.dof() {
                let limits = &model.joints()[j].limits;
                let mut before = position(&model, excite, 1, &centre, j, 0.0);
                for k in 1..=2000 {
                    let now = position(&model, excite, 1, &centre, j, 0.01 * f64::from(k));
                    assert!(limits.lower.is_none_or(|lower| now >= lower));
                    assert!(limits.upper.is_none_or(|upper| now <= upper));
                    let speed = (now - before).abs() / 0.01;
                    assert!(
                        limits.velocity.is_none_or(|most| speed <= most),
                        "{excite:?} {j}"
                    );
                    before = now;
                }
            }
        }
    }

    #[test]
    fn a_class_has_the_motion_that_splits_it() {
        for (a, b, expected) in [
            ("cable_spring", "counterbalance_spring", Excite::WholeRange),
            ("torque_delay", "torque_lowpass", Excite::Fast),
            ("payload", "link_mass", Excite::AllPoses),
            ("torque_gain", "torque_bias", Excite::AllPoses),
            ("stribeck_friction", "coulomb_friction", Excite::Creep),
        ] {
            let [a, b] = [a, b].map(|name| effect(name).unwrap());
            assert_eq!(Excite::of(a, b)[0], expected);
        }
    }
}
