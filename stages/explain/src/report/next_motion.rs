//! The motion that would tell apart what this data cannot: in words, and as a trajectory within the URDF's limits.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use tauscope_dynamics::terms::{Effect, Excitation, PlaceKind};
use tauscope_dynamics::{JointKind, Model};

use crate::physics::active::Hypothesis;
use crate::read::input::Input;
use crate::report::schema::{NextMotion, Rival};

/// Share of a joint's range and of its speed limit that a trajectory keeps within.
const RANGE: f64 = 0.8;
const SPEED: f64 = 0.7;
/// Where the URDF gives no limits \[rad or m, and per second\].
const DEFAULT_HALF_RANGE: f64 = 1.5;
const DEFAULT_SPEED: f64 = 1.0;
/// Highest acceleration \[rad/s² or m/s²\].
const ACCELERATION: f64 = 4.0;
/// How long a part of a trajectory lasts, and the step of its rows \[s\].
const PART_S: f64 = 20.0;
const STEP_S: f64 = 0.01;
/// The slowest of the speeds that a joint creeps at \[rad/s or m/s\]: twice what counts as standstill, and well
/// below the speeds at which Stribeck's friction falls. How many speeds there are, and each is so many times the
/// one before.
const CREEP: f64 = 0.02;
const SPEEDS: usize = 5;
const FASTER: f64 = 2.2;
/// How long such a speed takes to come and to go \[s\].
const RAMP_S: f64 = 0.3;

/// What a motion must excite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Excite {
    /// The whole range of one joint, slowly: springs and other functions of position.
    WholeRange,
    /// Fast reversals: what comes late, and rotors.
    Fast,
    /// One joint at constant speeds from creeping on, in both directions: kinds of friction near standstill.
    Creep,
    /// Every speed in both directions, with reversals: kinds of friction.
    AllSpeeds,
    /// Gravity from all sides: masses and their places, and factors of efforts.
    AllPoses,
}

impl Excite {
    /// What tells an effect from another.
    fn of(winner: &Effect, rival: &Effect) -> &'static [Self] {
        match winner.excitation.between(rival.excitation) {
            Excitation::Fast => &[Self::Fast],
            Excitation::Poses => &[Self::AllPoses],
            Excitation::WholeRange => &[Self::WholeRange],
            Excitation::Speeds => &[Self::Creep, Self::AllSpeeds],
        }
    }

    /// What tells `winner` from each of its rivals, one after the other.
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
                "Move joint {joint} slowly over its whole range, there and back, the other joints at rest: over a \
                 range of more than 60 degrees a spring, a counterbalance and a gain part."
            ),
            Self::Fast => "Move all joints fast, with reversals at rising frequency: a delay grows with frequency, a \
                           low-pass takes amplitude, an elastic joint resonates."
                .to_owned(),
            Self::Creep => format!(
                "Move joint {joint} at constant speeds from creeping on, there and back: some kinds of friction \
                 differ below a few degrees a second only."
            ),
            Self::AllSpeeds => format!(
                "Move joint {joint} at every speed up to fast, in both directions, with many reversals, in several \
                 poses of the arm: kinds of friction differ in what they depend on."
            ),
            Self::AllPoses => "Turn the last joints through their whole ranges, in several poses of the arm and with \
                               accelerations: a payload, a link's mass and its centre weigh differently in each, and a factor shows where there is effort."
                .to_owned(),
        }
    }
}

/// What to record next, for a finding with rivals that tie, and the trajectory as CSV text.
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
        trajectory: Some(format!("next_{}_{place}.csv", winner.effect.name)),
    };
    let centre = centre_of(input);
    Some((motion, csv(&input.model, &parts, joint, &centre)))
}

/// The middle of what the recordings moved in, which is known to be free.
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

/// How far a joint that creeps at one speed after the other, there and back, is from where it began at time `t`,
/// with speeds that need no more room than there is.
fn crept(room: f64, speed: f64, t: f64) -> f64 {
    let stroke_s = PART_S / (2 * SPEEDS) as f64;
    let stroke = (t / stroke_s) as i32;
    let speed = (CREEP * FASTER.powi(stroke / 2))
        .min(speed)
        .min(room / (stroke_s - RAMP_S));
    // The way under a trapezoid of speed: comes within RAMP_S, stays, goes within RAMP_S.
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
    let fade = |t: f64| (t / 2.0).min((PART_S - t) / 2.0).clamp(0.0, 1.0);
    let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
    // The largest swing of this frequency that speed, acceleration and range allow.
    let swing = |hz: f64| {
        let omega = TAU * hz;
        room.min(speed / omega).min(ACCELERATION / (omega * omega))
    };
    let wave = |hz: f64| 0.8 * swing(hz) * (TAU * hz * t).sin();
    let own = j == joint;
    let move_by = match excite {
        Excite::WholeRange if own => {
            let hz = (speed / (TAU * room.max(1e-6))).min(0.1);
            room.min(swing(hz)) * (TAU * hz * t).sin()
        }
        Excite::Creep if own => return middle + crept(room, speed, t),
        Excite::WholeRange | Excite::Creep => 0.0,
        Excite::Fast => {
            0.3 * wave(0.4 + 0.13 * j as f64)
                + 0.3 * wave(1.5 + 0.29 * j as f64)
                + 0.4 * wave(4.3 + 0.37 * j as f64)
        }
        Excite::AllSpeeds if own => 0.6 * wave(0.15) + 0.4 * wave(1.1),
        Excite::AllSpeeds => 0.5 * wave(0.11 + 0.03 * j as f64),
        Excite::AllPoses => 0.7 * wave(0.1 + 0.037 * j as f64) + 0.3 * wave(0.6 + 0.11 * j as f64),
    };
    middle + smooth(fade(t)) * move_by
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;

    #[test]
    fn trajectories_keep_within_the_limits() {
        let urdf = include_str!("../../../../tests/data/demo_arm.urdf");
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
