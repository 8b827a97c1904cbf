//! What would make recordings match that do not match the robot: each remedy of a short list is tried on the data.

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

/// A remedy must divide the error that friction and a gain leave by this, all joints together.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_GAIN: f64 = 3.0;
/// No joint's error may grow by more than this factor.
/// Tuned: as [`LEAST_GAIN`].
const HARMLESS: f64 = 1.1;
/// A joint whose error the remedy divides by at least this counts as mended.
/// Tuned: as [`LEAST_GAIN`].
const MENDED: f64 = 1.3;
/// Remedies are tried if the motion leaves this share of a joint's variance beside friction.
/// Tuned: as [`LEAST_GAIN`]. Most arms leave less at all strong joints and are not searched.
const SUSPECT: f64 = 0.1;

/// What makes recordings match the robot.
#[derive(Debug, Clone, PartialEq)]
pub enum Remedy {
    /// The base is turned: roll and pitch \[rad\], as in `base_tilt`. Physics, which the search names.
    BaseTurned([f64; 2]),
    /// The tool carries so much \[kg\]. Physics, too.
    Payload(f64),
    /// The efforts of two joints are swapped.
    Swapped(usize, usize),
    /// Two joints have each other's name: position, velocity and effort are swapped.
    NamesSwapped(usize, usize),
    /// The effort of a joint has the other sign.
    EffortTurned(usize),
    /// The effort of a joint is told without its sign: it is left out.
    EffortWithoutSign(usize),
    /// The position of a joint has the other sign.
    PositionTurned(usize),
    /// The position of a joint counts the other way, and its effort with it.
    JointTurned(usize),
    /// The positions of joints that turn are in degrees.
    Degrees,
    /// The controller has subtracted gravity from the effort.
    GravitySubtracted,
    /// The effort that is said to be in N m is motor current.
    IsCurrent,
    /// The effort that is said to be in N m is a share of something that differs from joint to joint, such as the rated torque.
    IsOfRating,
    /// The effort that is said to be motor current is in N m.
    IsTorque,
    /// The effort is so many times a N m at every joint.
    EffortScaled(f64),
    /// The torque constants are to be multiplied by this.
    ConstantsScaled(f64),
    /// The torque constants are wrong, and by no common factor.
    ConstantsWrong,
    /// The effort of a joint is one number throughout: it is left out.
    Unmeasured(usize, f64),
    /// The effort of a joint drops to exactly zero in this many messages: their rows are left out.
    DropsOut(usize, u64),
    /// The recorded velocity is so many times the change of position: of a joint, or of all.
    Velocity(Option<usize>, f64),
}

impl Remedy {
    /// The `kind` of its finding; of physics, which becomes a finding of the search, none.
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

    /// Whether the user left it out of the library.
    pub fn is_without(&self, without: &BTreeSet<String>) -> bool {
        self.kind().is_some_and(|kind| without.contains(kind))
    }

    /// Whether it says that each joint's effort has a scale of its own.
    pub fn is_of_each_joint(&self) -> bool {
        matches!(self, Self::IsCurrent | Self::IsOfRating)
    }

    /// By how much it must divide the error. An effort that is never below zero says so itself.
    fn least_gain(&self) -> f64 {
        match self {
            Self::EffortWithoutSign(_) => MENDED,
            _ => LEAST_GAIN,
        }
    }
}

/// A remedy that was tried and helps.
#[derive(Debug, Clone)]
pub struct Slip {
    /// What helps.
    pub remedy: Remedy,
    /// By joint that it mends, the error without and with it, beside friction and a gain \[N m, or A where the scale is not
    /// known\].
    pub mended: Vec<(usize, [f64; 2])>,
    /// Share of the squared error, in units of what is left, that it takes away.
    pub share: f64,
    /// By joint that tells, measured effort per effort that the motion requires, or recorded velocity per change of position.
    pub slopes: Vec<(usize, f64)>,
}

/// How the recorded columns are read.
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
    /// Whether gravity is part of the effort.
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

    /// The same after a remedy that is no physics.
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

/// What the audit found.
#[derive(Debug, Default)]
pub struct Audit {
    /// What is wrong with the recordings, the worst first.
    pub slips: Vec<Slip>,
    /// Physics that explains what does not match.
    pub physics: Option<Remedy>,
}

/// Tries remedies, one after the other, until none helps. `is_scaled` says whether efforts are N m, so that gains are near 1.
/// Kinds in `without` are not tried.
pub fn audit(problem: &Problem, is_scaled: bool, without: &BTreeSet<String>) -> Audit {
    let trial = Trial::new(problem, is_scaled);
    let n = problem.joints;
    let turns: Vec<bool> = (problem.model.joints().iter())
        .map(|joint| joint.kind != JointKind::Prismatic)
        .collect();
    let mut reading = Reading::as_recorded(n);
    let mut model = problem.rigid().to_vec();
    // What a corrected twin has beside its URDF. It stays, so that a position turned twice is the position as it was.
    let urdf = trial.model(&reading);
    let mut beside: Vec<f64> = model
        .iter()
        .zip(urdf)
        .map(|(twin, urdf)| twin - urdf)
        .collect();
    let mut found = Audit::default();
    // Each joint may be turned and be in another's place; more is another robot.
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
                // What it has beside it was computed from degrees, too.
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

/// Whether efforts that look like another unit are torques of a robot with one wrong body: a decimal point that slipped.
pub fn is_one_body(problem: &Problem) -> bool {
    Trial::new(problem, true).is_one_body()
}

/// The direction of gravity in the base by which a robot would fit these efforts best, if it is not that of its model.
pub fn turned_gravity(problem: &Problem) -> Option<[f64; 3]> {
    Trial::new(problem, true).turned_gravity().map(Into::into)
}

/// All remedies that can be tried on a reading.
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

/// By how much the error falls, as the logarithm of its factor, over all joints that told it before. Nothing if a joint or a
/// recording says otherwise; a joint that told nothing before says so if it has got an effort that its motion leaves.
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
