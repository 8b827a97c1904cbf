//! The motion that would distinguish effects that this data does not: as text, and as a trajectory within the URDF's
//! limits.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use tauscope_dynamics::terms::{Effect, Excitation, PlaceKind};
use tauscope_dynamics::{JointKind, Model};

use crate::physics::active::Hypothesis;
use crate::read::input::Input;
use crate::report::schema::{NextMotion, Rival};

/// File name prefix of a motion to record next.
pub const MOTION_PREFIX: &str = "next_";

/// Share of a joint's range, and of its speed limit, that a trajectory uses.
/// Physical: a fifth stays free for a controller that overshoots.
const SHARE: f64 = 0.8;
/// Half the range of a joint without position limits in the URDF \[rad or m\].
/// Physical: a quarter of a turn to either side.
const DEFAULT_HALF_RANGE: f64 = 1.5;
/// Speed limit of a joint without one in the URDF \[rad/s or m/s\].
/// Physical: well within the speed of collaborative arms.
const DEFAULT_SPEED: f64 = 1.0;
/// Highest acceleration \[rad/s² or m/s²\].
/// Physical: URDFs give none, and collaborative arms reach it.
const ACCELERATION: f64 = 4.0;
/// Duration of a part of a trajectory \[s\].
/// Resolution: two periods of its slowest wave.
const PART_S: f64 = 20.0;
/// Time between two rows of a trajectory \[s\].
/// Resolution: 100 rows per second; changes the file's size.
const STEP_S: f64 = 0.01;
/// Slowest speed of a creeping joint \[rad/s or m/s\].
/// Physical: twice the limit of standstill, and well below typical Stribeck velocities.
const CREEP: f64 = 0.02;
/// Number of speeds of a creeping joint, and ratio of each to the one before.
/// Resolution: evenly by logarithm from creeping to half a rad/s.
const SPEEDS: usize = 5;
const FASTER: f64 = 2.2;
/// Duration of the ramps to the speed of a creeping joint and back to zero \[s\].
/// Physical: at the highest of these speeds, less than [`ACCELERATION`].
const RAMP_S: f64 = 0.3;
/// Duration of the fade-in and the fade-out of the other motions \[s\].
/// Resolution: a tenth of a part.
const FADE_S: f64 = 2.0;
/// Number of harmonics of a wave.
/// Resolution: as in Swevers et al., "Optimal Robot Excitation and Identification", *IEEE Transactions on Robotics
/// and Automation* 13, 1997.
const HARMONICS: u32 = 5;
/// Phase difference between two harmonics, which keeps joints and harmonics out of phase \[rad\].
/// Resolution: the golden angle.
const PHASE: f64 = 2.4;

/// The excitation that a motion must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Excite {
    /// The whole range of one joint, slowly: springs and other functions of position.
    WholeRange,
    /// Fast reversals: delays and rotors.
    Fast,
    /// One joint at constant speeds, the slowest first, in both directions: kinds of friction near standstill.
    Creep,
    /// Every speed in both directions, with reversals: kinds of friction.
    AllSpeeds,
    /// Gravity from all sides: masses, centres of mass and gains.
    AllPoses,
}

impl Excite {
    /// Returns the motions that distinguish two effects.
    fn of(winner: &Effect, rival: &Effect) -> &'static [Self] {
        match winner.excitation.between(rival.excitation) {
            Excitation::Fast => &[Self::Fast],
            Excitation::Poses => &[Self::AllPoses],
            Excitation::WholeRange => &[Self::WholeRange],
            Excitation::Speeds => &[Self::Creep, Self::AllSpeeds],
        }
    }

    /// Returns the motions that distinguish `winner` from each of its alternatives.
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

/// Returns the motion to record next for a finding with equally likely alternatives, and its trajectory as CSV text.
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

/// Returns the middle of each joint's recorded range, which is known to be free of obstacles.
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

/// Writes the trajectory: the header `t,` and the joints' names; positions \[rad or m\], one part after the other.
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

/// Returns the distance at time `t` from the start of a joint that creeps there and back at one speed after the
/// other. Each speed is limited so that the joint stays within `room`.
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

/// Returns the position of joint `j` at time `t` of a motion about `centre`, within the limits, from rest to rest.
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
    let room = SHARE * (upper - middle).min(middle - lower).max(0.0);
    let speed = SHARE * limits.velocity.unwrap_or(DEFAULT_SPEED);
    // Fades in and out, so that it begins and ends at rest.
    let fade = (t / FADE_S).min((PART_S - t) / FADE_S).clamp(0.0, 1.0);
    let fade = fade * fade * (3.0 - 2.0 * fade);
    let own = j == joint;
    let base_hz = match excite {
        Excite::Creep if own => return middle + crept(room, speed, t),
        Excite::Creep => return middle,
        Excite::WholeRange if !own => return middle,
        Excite::WholeRange | Excite::AllPoses => 2.0 / PART_S,
        Excite::AllSpeeds => 4.0 / PART_S,
        Excite::Fast => 8.0 / PART_S,
    };
    middle + fade * wave(base_hz, j, [room, speed, ACCELERATION], t)
}

/// Evaluates a finite Fourier series whose harmonics have equal velocity amplitudes, as large as these limits of
/// position, velocity and acceleration allow (Swevers et al., 1997).
fn wave(base_hz: f64, joint: usize, [position, velocity, acceleration]: [f64; 3], t: f64) -> f64 {
    let omega = TAU * base_hz;
    let all = || (1..=HARMONICS).map(f64::from);
    let largest: f64 = all().map(|l| 1.0 / l).sum();
    // The fade adds at most 1.5 / FADE_S of the position to the velocity.
    let fastest = all().map(|_| omega).sum::<f64>() + 1.5 / FADE_S * largest;
    let hardest = omega * omega * all().sum::<f64>();
    let amplitude = (position / largest)
        .min(velocity / fastest)
        .min(acceleration / hardest);
    let phase = |l: f64| PHASE * (l + f64::from(HARMONICS) * joint as f64);
    let series = all().map(|l| (l * omega * t + phase(l)).sin() / l);
    amplitude * series.sum::<f64>()
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
