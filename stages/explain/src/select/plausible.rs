//! Numbers that a robot may have, and times that tell something.

use tauscope_dynamics::terms::{CoordinateKind, Scale};
use tauscope_dynamics::{Limits, Model};

use crate::data::problem::Problem;
use crate::physics::active::{Active, TimeKind};
use crate::physics::kinematic_tree::{extent_m, moving_link, reach_m};

/// Friction that changes, once or as the joint warms up, leaves at least this share of what it was: none comes from nothing or
/// goes for good.
const LEAST_LEFT: f64 = 0.1;
/// What lasts for an interval of one recording lasts at most for this share of it; what lasts longer is not told from an offset.
const LONGEST_SHARE: f64 = 0.75;
/// Friction of one direction is at least this share of the other's; what looks more lopsided is friction and an offset. In
/// motion the two are the same: a forward and b backward are friction of (a + b)/2 and an offset of (a - b)/2. The share
/// says which of two equal descriptions is named: at 0.2 the offset is two thirds of the friction. A convention.
const LEAST_SYMMETRY: f64 = 0.2;
/// Friction that falls with speed keeps at least this share of what it is when a joint breaks away: none falls to nothing.
const LEAST_SLIDING: f64 = 0.2;
/// A link's centre of mass stays within the link. Physical: a uniform rod ends the root of 3 radii of gyration from its
/// centre (its moment of inertia is m l²/12), a plumper body nearer; a link that reaches farther to one of its frames is
/// at least as long as that.
const MOST_GYRATIONS: f64 = 1.732;
/// What is behind a gear comes back after a revolution: slower waves are whole numbers of cycles in it, within what is known of them.
const MOST_WHOLE_CYCLES: f64 = 30.0;
const NEARLY_WHOLE: f64 = 0.15;
/// A wall is at least so stiff: what is softer is a force that is always there. (It must also be within the arm's reach.)
const SOFTEST_WALL_N_PER_M: f64 = 5.0;
/// A spring hangs loose within the range of its joint or this many times its width beside it: farther off it is a constant effort. Where the
/// URDF knows no range it is taken to be a turn either way.
const LOOSE_BESIDE: f64 = 1.0;
/// A stronger force is none that pushes a robot \[N\]: it hardly acts on the joints that would feel a weaker one elsewhere.
const STRONGEST_N: f64 = 1000.0;
/// A rotor on the spring of its gear resonates at least this fast against a link that stands still.
const SOFTEST_RAD_S: f64 = 3.0 * std::f64::consts::TAU;
/// A joint breaks away within this: bristles that give more are a spring \[rad or m\].
const MOST_PRESLIDING_RAD: f64 = 0.1;
/// What began or ended so much beside a recording began or ended with it \[s\].
const BESIDE_S: f64 = 0.5;
/// A change of friction smaller than this share of it is what friction does from day to day.
const LEAST_STEP: f64 = 0.3;

fn hangs_loose_near(limits: &Limits, rest: f64) -> bool {
    let turn = std::f64::consts::TAU;
    let (lower, upper) = (limits.lower.unwrap_or(-turn), limits.upper.unwrap_or(turn));
    let beside = LOOSE_BESIDE * (upper - lower);
    (lower - beside..=upper + beside).contains(&rest)
}

/// Whether the times of a piece of physics are ones that tell something: friction that changes once changes by more than friction
/// does from day to day and does not vanish, and what comes and goes does both within a recording.
pub fn is_timely(problem: &Problem, active: &Active) -> bool {
    let x = &active.coordinates;
    match active.hypothesis.time_kind() {
        TimeKind::Step => {
            let (less, more) = (x[0].min(x[1]), x[0].max(x[1]));
            more - less > LEAST_STEP * more && less >= LEAST_LEFT * more
        }
        TimeKind::Once => {
            let [.., start_s, end_s] = x[..] else {
                return true;
            };
            problem.tracks.iter().map(|t| &t.track).any(|track| {
                let first_s = track.session_s;
                let length_s = track.time_s.last().copied().unwrap_or(0.0);
                let within = start_s > first_s - BESIDE_S && end_s < first_s + length_s + BESIDE_S;
                within && end_s - start_s <= LONGEST_SHARE * length_s
            })
        }
        TimeKind::Always | TimeKind::EveryRecording => true,
    }
}

/// Whether a wave over a joint's position does not close after a revolution.
pub fn is_open_wave(active: &Active) -> bool {
    let [_, _, cycles] = active.coordinates[..] else {
        return false;
    };
    active.hypothesis.effect.name == "torque_ripple"
        && cycles < MOST_WHOLE_CYCLES
        && (cycles - cycles.round()).abs() > NEARLY_WHOLE
}

/// Nearer than this to the end of its range, as a share of it, a shape is there.
const AT_BOUND: f64 = 1e-3;

/// Whether one of the shapes is where its range ends: then the effect may only be a way to say something else.
pub fn at_bound(active: &Active) -> bool {
    (0..active.coordinates.len()).any(|c| match active.kind(c) {
        CoordinateKind::Shape {
            lower,
            upper,
            scale: Scale::Log,
            ..
        } => {
            let share = (active.coordinates[c] / lower).ln() / (upper / lower).ln();
            !(AT_BOUND..=1.0 - AT_BOUND).contains(&share)
        }
        _ => false,
    })
}

/// Whether the numbers are ones that a robot may have: a link's mass stays above nothing and within twice what its URDF says,
/// its centre within the link, a push is not beyond all strength, a wall is neither soft nor out of reach, a spring hangs loose somewhere, a gear is no soft spring nor are its bristles, and friction is neither of one direction
/// alone nor falls to nothing with speed or warmth.
pub fn plausible(active: &Active, model: &Model) -> bool {
    let x = &active.coordinates;
    let link = &model.links()[active.hypothesis.place.link];
    match active.hypothesis.effect.name {
        "link_mass" => x[0].abs() < link.mass_kg(),
        "link_com" => {
            let shift_m = active
                .parameters()
                .iter()
                .map(|d| d * d)
                .sum::<f64>()
                .sqrt();
            let extent_m = extent_m(model, active.hypothesis.place.link);
            shift_m < extent_m.max(MOST_GYRATIONS * link.gyration_radius_m())
        }
        "contact_wall" => {
            let link = moving_link(model, active.hypothesis.place.link);
            x[0] >= SOFTEST_WALL_N_PER_M && x[3].abs() < reach_m(model, link)
        }
        "external_push" => x[..3].iter().map(|f| f * f).sum::<f64>().sqrt() < STRONGEST_N,
        "cable_spring" => {
            let joint = &model.joints()[active.hypothesis.place.joint];
            hangs_loose_near(&joint.limits, active.parameters()[1])
        }
        "joint_elasticity" => (x[1] / x[0].max(1e-12)).sqrt() >= SOFTEST_RAD_S,
        "presliding_hysteresis" => x[2] >= 1.0 / MOST_PRESLIDING_RAD,
        "temperature_viscous" => x[0] >= LEAST_LEFT * (x[0] + x[1]),
        "stribeck_friction" => x[0] >= LEAST_SLIDING * (x[0] + x[1]),
        "asymmetric_coulomb" => x[0].min(x[1]) >= LEAST_SYMMETRY * x[0].max(x[1]),
        _ => true,
    }
}
