//! Search for the correction of recordings that do not match the robot: each remedy of a short list is tried on the
//! data.

mod dropouts;
mod mend;
mod scale;
mod trial;
mod unmeasured;
mod velocity;

use std::collections::BTreeSet;

use tauscope_dynamics::JointKind;

use crate::data::problem::Problem;

pub use dropouts::of_dropouts;
pub use scale::of_scale;
use trial::{Left, Trial};
pub use unmeasured::of_unmeasured;
pub use velocity::of_velocity;

/// Smallest factor by which a remedy must reduce the error left by friction and a gain, over all joints.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_GAIN: f64 = 3.0;
/// Largest factor by which a remedy may increase the error of any joint.
/// Tuned: as [`LEAST_GAIN`].
const HARMLESS: f64 = 1.1;
/// Smallest error reduction of a joint that a remedy corrects, as a factor.
/// Tuned: as [`LEAST_GAIN`].
const MENDED: f64 = 1.3;
/// Share of a joint's variance after friction that must be left unexplained by the motion before remedies are tried.
/// Tuned: as [`LEAST_GAIN`]. Most arms leave less at all strong joints and are not searched.
const SUSPECT: f64 = 0.1;

/// A correction of the recordings or of their description.
#[derive(Debug, Clone, PartialEq)]
pub enum Remedy {
    /// The base is mounted with this roll and pitch \[rad\], as in `base_tilt`. Physics, which the search reports.
    BaseTurned([f64; 2]),
    /// The tool carries a payload of this mass \[kg\]. Physics, too.
    Payload(f64),
    /// The efforts of two joints are swapped.
    Swapped(usize, usize),
    /// The names of two joints are swapped: position, velocity and effort are swapped.
    NamesSwapped(usize, usize),
    /// The effort of a joint has the other sign.
    EffortTurned(usize),
    /// The effort of a joint is a magnitude without sign: it is left out.
    EffortWithoutSign(usize),
    /// The position of a joint has the other sign.
    PositionTurned(usize),
    /// The position and the effort of a joint have the other sign.
    JointTurned(usize),
    /// The positions of rotary joints are in degrees.
    Degrees,
    /// The controller has subtracted gravity from the effort.
    GravitySubtracted,
    /// The effort declared as N m is motor current.
    IsCurrent,
    /// The effort declared as N m is relative to a quantity that differs from joint to joint, such as the rated
    /// torque.
    IsOfRating,
    /// The effort declared as motor current is in N m.
    IsTorque,
    /// The effort of all joints is this multiple of its value in N m.
    EffortScaled(f64),
    /// The torque constants must be multiplied by this factor.
    ConstantsScaled(f64),
    /// The torque constants are wrong, without a common factor.
    ConstantsWrong,
    /// The effort of a joint is constant, with this value: it is left out.
    Unmeasured(usize, f64),
    /// The effort of a joint drops to exactly zero in this number of messages: their rows are left out.
    DropsOut(usize, u64),
    /// The recorded velocity is this multiple of the change of position: of a joint, or of all.
    Velocity(Option<usize>, f64),
}

impl Remedy {
    /// Returns the `kind` of its finding; `None` for physics, which the search reports.
    pub fn kind(&self) -> Option<&'static str> {
        Some(match self {
            Self::Swapped(..) => "efforts_swapped",
            Self::NamesSwapped(..) => "names_swapped",
            Self::EffortTurned(_) => "effort_sign",
            Self::EffortWithoutSign(_) => "effort_without_sign",
            Self::PositionTurned(_) => "position_sign",
            Self::JointTurned(_) => "joint_sign",
            Self::Degrees => "degrees",
            Self::GravitySubtracted => "gravity_subtracted",
            Self::IsCurrent | Self::IsOfRating | Self::IsTorque | Self::EffortScaled(_) => {
                "effort_unit"
            }
            Self::ConstantsScaled(_) | Self::ConstantsWrong => "torque_constant",
            Self::Velocity(..) => "velocity_scale",
            Self::Unmeasured(..) => "effort_constant",
            Self::DropsOut(..) => "effort_dropout",
            Self::BaseTurned(_) | Self::Payload(_) => return None,
        })
    }

    /// Whether the user excluded it from the library.
    pub fn is_without(&self, without: &BTreeSet<String>) -> bool {
        self.kind().is_some_and(|kind| without.contains(kind))
    }

    /// Whether each joint's effort has a scale of its own.
    pub fn is_of_each_joint(&self) -> bool {
        matches!(self, Self::IsCurrent | Self::IsOfRating)
    }

    /// Returns the factor by which it must reduce the error. An effort that is never negative is evidence in itself.
    fn least_gain(&self) -> f64 {
        match self {
            Self::EffortWithoutSign(_) => MENDED,
            _ => LEAST_GAIN,
        }
    }
}

/// A remedy that reduces the error: a fault of the recordings.
#[derive(Debug, Clone)]
pub struct Slip {
    /// The correction.
    pub remedy: Remedy,
    /// Errors without and with it, after friction and a gain, by corrected joint
    /// \[N m, or A where the scale is unknown\].
    pub mended: Vec<(usize, [f64; 2])>,
    /// Share of the squared error that it explains, in units of the remaining error.
    pub share: f64,
    /// Measured over required effort, or recorded velocity over change of position, by informative joint.
    pub slopes: Vec<(usize, f64)>,
}

/// An assignment of the recorded columns to joints, with signs and units.
#[derive(Debug, Clone, PartialEq)]
struct Reading {
    /// By joint, the joint whose effort column holds its effort.
    column: Vec<usize>,
    /// By joint, the joint whose position column holds its position.
    place: Vec<usize>,
    /// By joint, the factor of its effort.
    effort: Vec<f64>,
    /// By joint, the factor of its position.
    position: Vec<f64>,
    /// Whether the effort includes gravity.
    weighs: bool,
    /// By joint, whether its effort has no sign.
    without_sign: Vec<bool>,
}

impl Reading {
    fn as_recorded(joints: usize) -> Self {
        Self {
            column: (0..joints).collect(),
            place: (0..joints).collect(),
            effort: vec![1.0; joints],
            position: vec![1.0; joints],
            weighs: true,
            without_sign: vec![false; joints],
        }
    }

    /// Returns the reading after a remedy that is not physics.
    fn with(&self, remedy: &Remedy, turns: &[bool]) -> Self {
        let mut new = self.clone();
        match *remedy {
            Remedy::Swapped(a, b) => new.column.swap(a, b),
            Remedy::NamesSwapped(a, b) => {
                new.column.swap(a, b);
                new.place.swap(a, b);
            }
            Remedy::EffortTurned(j) => new.effort[j] *= -1.0,
            Remedy::EffortWithoutSign(j) => new.without_sign[j] = true,
            Remedy::PositionTurned(j) => new.position[j] *= -1.0,
            Remedy::JointTurned(j) => {
                new.effort[j] *= -1.0;
                new.position[j] *= -1.0;
            }
            Remedy::Degrees => {
                for (factor, turns) in new.position.iter_mut().zip(turns) {
                    if *turns {
                        *factor *= std::f64::consts::PI / 180.0;
                    }
                }
            }
            Remedy::GravitySubtracted => new.weighs = false,
            _ => {}
        }
        new
    }
}

/// The result of an audit.
#[derive(Debug, Default)]
pub struct Audit {
    /// Faults of the recordings, the largest first.
    pub slips: Vec<Slip>,
    /// Physics that explains the mismatch.
    pub physics: Option<Remedy>,
}

/// Applies the best remedy, one after the other, until none helps. `is_scaled` states whether efforts are in N m, so
/// that gains are near 1. Kinds in `without` are not tried.
pub fn audit(problem: &Problem, is_scaled: bool, without: &BTreeSet<String>) -> Audit {
    let trial = Trial::new(problem, is_scaled);
    let n = problem.joints;
    let turns: Vec<bool> = (problem.model.joints().iter())
        .map(|joint| joint.kind != JointKind::Prismatic)
        .collect();
    let mut reading = Reading::as_recorded(n);
    let mut model = problem.rigid().to_vec();
    // The effort of a corrected twin in addition to its URDF. It stays unchanged, so that turning a position twice
    // restores the original model.
    let urdf = trial.model(&reading);
    let mut beside: Vec<f64> = model
        .iter()
        .zip(urdf)
        .map(|(twin, urdf)| twin - urdf)
        .collect();
    let mut found = Audit::default();
    // Each joint may be turned and swapped with another; more faults indicate another robot.
    while found.slips.len() < 2 * n {
        let now = trial.left(&model, &reading);
        if !now.iter().flatten().any(Left::is_suspect) {
            break;
        }
        let physics = if found.slips.is_empty() {
            trial.physics()
        } else {
            Vec::new()
        };
        let physics = (physics.into_iter()).filter_map(|(remedy, model)| {
            let gain = total_gain(&now, &trial.left(&model, &reading))?;
            Some((remedy, gain))
        });
        let physics = physics.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let mut best: Option<(Slip, Reading, Vec<f64>, f64)> = None;
        let mut tried = candidates(n, &turns, &reading);
        tried.extend(trial.without_sign(&model, &reading));
        tried.retain(|remedy| !remedy.is_without(without));
        for remedy in tried {
            let new = reading.with(&remedy, &turns);
            let moved = (&new.position, &new.place, new.weighs)
                != (&reading.position, &reading.place, reading.weighs);
            let model = if remedy == Remedy::Degrees {
                // The twin's additional effort was computed from degrees, too.
                trial.model(&new)
            } else if moved {
                let urdf = trial.model(&new).into_iter().zip(&beside);
                urdf.map(|(urdf, beside)| urdf + beside).collect()
            } else {
                model.clone()
            };
            let after = trial.left(&model, &new);
            let Some(gain) = total_gain(&now, &after) else {
                continue;
            };
            if best.as_ref().is_none_or(|(_, _, _, most)| gain > *most) {
                let slip = slip(remedy, &now, &after);
                best = Some((slip, new, model, gain));
            }
        }
        let most = best.as_ref().map_or(0.0, |(_, _, _, gain)| *gain);
        if let Some((remedy, gain)) = physics
            && gain >= most
            && gain > LEAST_GAIN.ln()
        {
            found.physics = Some(remedy);
            break;
        }
        let Some((slip, new, moved, _)) =
            best.filter(|(slip, ..)| most > slip.remedy.least_gain().ln())
        else {
            break;
        };
        if slip.remedy == Remedy::Degrees {
            beside.fill(0.0);
        }
        found.slips.push(slip);
        (reading, model) = (new, moved);
    }
    found
}

/// Whether one wrong body explains efforts that appear to be in another unit, such as a mass with a misplaced decimal
/// point.
pub fn is_one_body(problem: &Problem) -> bool {
    Trial::new(problem, true).is_one_body()
}

/// Returns the direction of gravity in the base that fits these efforts best, if it differs from that of the model.
pub fn turned_gravity(problem: &Problem) -> Option<[f64; 3]> {
    Trial::new(problem, true).turned_gravity().map(Into::into)
}

/// Returns the remedies that apply to a reading.
fn candidates(n: usize, turns: &[bool], reading: &Reading) -> Vec<Remedy> {
    let mut all = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            all.extend([Remedy::Swapped(a, b), Remedy::NamesSwapped(a, b)]);
        }
        all.push(Remedy::EffortTurned(a));
        all.push(Remedy::PositionTurned(a));
        all.push(Remedy::JointTurned(a));
    }
    let plain = |j: usize| reading.position[j].abs() >= 1.0;
    if turns.contains(&true) && (0..n).all(plain) {
        all.push(Remedy::Degrees);
    }
    if reading.weighs {
        all.push(Remedy::GravitySubtracted);
    }
    all
}

/// Returns the logarithm of the error reduction, summed over the joints that were informative before. `None` if the
/// error of a joint or a recording grows. A joint that was not informative before contradicts a remedy if it gets an
/// effort that its motion does not explain.
fn total_gain(before: &[Option<Left>], after: &[Option<Left>]) -> Option<f64> {
    let known = before.iter().zip(after);
    let known = known.filter_map(|(a, b)| a.as_ref().zip(b.as_ref()));
    let is_worse = |(before, after): (&Left, &Left)| {
        after.rms() > HARMLESS * before.rms() && (before.tells || after.is_suspect())
    };
    if known.clone().any(is_worse) {
        return None;
    }
    let pairs = || known.clone().filter(|(before, _)| before.tells);
    let recordings = pairs().map(|(left, _)| left.squares.len()).max()?;
    let in_recording = |r: usize| -> f64 {
        let gain = |(a, b): (&Left, &Left)| 0.5 * (a.squares[r] / b.squares[r]).ln();
        pairs().map(gain).sum()
    };
    if (0..recordings).any(|r| in_recording(r) < 0.0) {
        return None;
    }
    Some(pairs().map(|(a, b)| (a.rms() / b.rms()).ln()).sum())
}

fn slip(remedy: Remedy, before: &[Option<Left>], after: &[Option<Left>]) -> Slip {
    let pairs = before.iter().zip(after).enumerate();
    let telling = |left: &Option<Left>| left.clone().filter(|left| left.tells);
    let known = pairs.filter_map(|(j, (a, b))| Some((j, [telling(a)?.rms(), b.as_ref()?.rms()])));
    let known: Vec<(usize, [f64; 2])> = known.collect();
    let sum = |of: usize| -> f64 {
        let scaled = |(_, errors): &(usize, [f64; 2])| (errors[of] / errors[1]).powi(2);
        known.iter().map(scaled).sum()
    };
    Slip {
        remedy,
        share: 1.0 - sum(1) / sum(0).max(f64::MIN_POSITIVE),
        mended: (known.iter().copied())
            .filter(|(_, [before, after])| before > &(MENDED * after))
            .collect(),
        slopes: Vec::new(),
    }
}

#[cfg(test)]
mod tests;
