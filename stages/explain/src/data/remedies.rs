//! What would make recordings match that do not match the robot: each remedy of a short list is tried on the data.

mod mend;
mod scale;
mod trial;
mod velocity;

use tauscope_dynamics::JointKind;

use crate::data::problem::Problem;

pub use scale::of_scale;
use trial::{Left, Trial};
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
    /// The effort of a joint has the other sign.
    EffortTurned(usize),
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
    /// The effort that is said to be motor current is in N m.
    IsTorque,
    /// The effort is so many times a N m at every joint.
    EffortScaled(f64),
    /// The torque constants are to be multiplied by this.
    ConstantsScaled(f64),
    /// The torque constants are wrong, and by no common factor.
    ConstantsWrong,
    /// The recorded velocity is so many times the change of position: of a joint, or of all.
    Velocity(Option<usize>, f64),
}

impl Remedy {
    /// Whether it is physics that the search can name, and no fault of the recording.
    pub fn is_physics(&self) -> bool {
        matches!(self, Self::BaseTurned(_) | Self::Payload(_))
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
    /// By joint, the factor of its effort.
    effort: Vec<f64>,
    /// By joint, the factor of its position.
    position: Vec<f64>,
    /// Whether gravity is part of the effort.
    weighs: bool,
}

impl Reading {
    fn as_recorded(joints: usize) -> Self {
        Self {
            column: (0..joints).collect(),
            effort: vec![1.0; joints],
            position: vec![1.0; joints],
            weighs: true,
        }
    }

    /// The same after a remedy that is no physics.
    fn with(&self, remedy: &Remedy, turns: &[bool]) -> Self {
        let mut new = self.clone();
        match *remedy {
            Remedy::Swapped(a, b) => new.column.swap(a, b),
            Remedy::EffortTurned(j) => new.effort[j] *= -1.0,
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
pub fn audit(problem: &Problem, is_scaled: bool) -> Audit {
    let trial = Trial::new(problem, is_scaled);
    let n = problem.joints;
    let turns: Vec<bool> = (problem.model.joints().iter())
        .map(|joint| joint.kind != JointKind::Prismatic)
        .collect();
    let mut reading = Reading::as_recorded(n);
    let mut model = problem.rigid().to_vec();
    let mut found = Audit::default();
    // Each joint may be turned and be in another's place; more is another robot.
    while found.slips.len() < 2 * n {
        let now = trial.left(&model, &reading);
        if !now.iter().flatten().any(|left| left.share() > SUSPECT) {
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
        for remedy in candidates(n, &turns, &reading) {
            let new = reading.with(&remedy, &turns);
            let moved = new.position != reading.position || new.weighs != reading.weighs;
            let model = if moved {
                trial.model(&new)
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
        let Some((slip, new, moved, _)) = best.filter(|_| most > LEAST_GAIN.ln()) else {
            break;
        };
        found.slips.push(slip);
        (reading, model) = (new, moved);
    }
    found
}

/// All remedies that can be tried on a reading.
fn candidates(n: usize, turns: &[bool], reading: &Reading) -> Vec<Remedy> {
    let mut all = Vec::new();
    for a in 0..n {
        all.extend((a + 1..n).map(|b| Remedy::Swapped(a, b)));
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

/// By how much the error falls, as the logarithm of its factor, all joints together. Nothing if a joint or a recording says
/// otherwise.
fn total_gain(before: &[Option<Left>], after: &[Option<Left>]) -> Option<f64> {
    let pairs = || {
        before
            .iter()
            .zip(after)
            .filter_map(|(a, b)| a.as_ref().zip(b.as_ref()))
    };
    if pairs().any(|(before, after)| after.rms() > HARMLESS * before.rms()) {
        return None;
    }
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
    let known = pairs.filter_map(|(j, (a, b))| Some((j, [a.as_ref()?.rms(), b.as_ref()?.rms()])));
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
mod tests {
    use tauscope_dynamics::{Inertia, Model};

    use super::mend::scale;
    use super::*;
    use crate::fixture::{self, Noise};
    use crate::read::recording::Recording;

    /// What is found in two recordings of the small arm, with friction, that `spoil` has changed.
    fn found(spoil: impl Fn(&mut Recording)) -> Audit {
        let model = fixture::model();
        let mut noise = Noise(7);
        let recordings = [4, 5].map(|seed| {
            let mut recording = fixture::recording(&model, seed, |_, qd, effort| {
                effort[0] += 2.0 * qd[0].signum() + 0.05 * noise.next();
                effort[1] += 0.5 * qd[1].signum() + 0.05 * noise.next();
            });
            spoil(&mut recording);
            recording
        });
        audit(&fixture::problem(&model, &recordings), true)
    }

    fn remedies(audit: Audit) -> Vec<Remedy> {
        assert_eq!(audit.physics, None);
        audit.slips.into_iter().map(|slip| slip.remedy).collect()
    }

    fn turn(rows: &mut [f64], joint: usize) {
        scale(rows, joint, 2, -1.0);
    }

    #[test]
    fn what_fits_needs_no_remedy() {
        assert_eq!(remedies(found(|_| {})), []);
    }

    #[test]
    fn swapped_efforts_turned_signs_and_degrees_are_told() {
        let swap = |r: &mut Recording| r.effort.chunks_mut(2).for_each(|row| row.swap(0, 1));
        assert_eq!(remedies(found(swap)), [Remedy::Swapped(0, 1)]);
        assert_eq!(
            remedies(found(|r| turn(&mut r.effort, 1))),
            [Remedy::EffortTurned(1)]
        );
        let both = found(|r| {
            turn(&mut r.effort, 0);
            turn(&mut r.effort, 1);
        });
        let both = remedies(both);
        assert!(
            both.len() == 2 && both.contains(&Remedy::EffortTurned(0)),
            "{both:?}"
        );
        let counts = remedies(found(|r| {
            for all in [&mut r.position, &mut r.velocity, &mut r.effort] {
                turn(all, 0);
            }
        }));
        // Seen in a mirror, this arm with one joint turned is the one with the other turned.
        assert!(matches!(counts[..], [Remedy::JointTurned(_)]), "{counts:?}");
        let degrees = remedies(found(|r| {
            let angles = r.position.iter_mut().chain(&mut r.velocity);
            angles.for_each(|x| *x = x.to_degrees());
        }));
        assert_eq!(degrees, [Remedy::Degrees]);
    }

    #[test]
    fn a_mended_recording_is_as_it_was_and_a_prediction_for_it_finds_back() {
        let model = fixture::model();
        let whole = fixture::recording(&model, 4, |_, _, _| {});
        for remedy in [
            Remedy::Swapped(0, 1),
            Remedy::EffortTurned(1),
            Remedy::JointTurned(0),
            Remedy::EffortScaled(100.0),
        ] {
            // Each of these undoes itself, but for a factor.
            let mut spoilt = whole.clone();
            remedy.undo(&mut spoilt.effort, 2);
            let recorded = spoilt.effort.clone();
            if let Remedy::JointTurned(j) = remedy {
                turn(&mut spoilt.position, j);
                turn(&mut spoilt.velocity, j);
            }
            remedy.mend(&mut spoilt, 2);
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(near(&spoilt.effort, &whole.effort), "{remedy:?}");
            assert!(near(&spoilt.position, &whole.position), "{remedy:?}");
            remedy.undo(&mut spoilt.effort, 2);
            assert!(near(&spoilt.effort, &recorded), "{remedy:?}");
        }
    }

    #[test]
    fn a_turned_base_and_a_heavy_payload_are_physics_with_their_numbers() {
        let told = |change: &dyn Fn(&mut Model)| {
            let model = fixture::model();
            let mut real = model.clone();
            change(&mut real);
            let recordings = [4, 5].map(|seed| fixture::recording(&real, seed, |_, _, _| {}));
            audit(&fixture::problem(&model, &recordings), true).physics
        };
        let ceiling = told(&|real| real.set_gravity([0.0, 0.0, 9.81]));
        let Some(Remedy::BaseTurned([roll, pitch])) = ceiling else {
            panic!("{ceiling:?}");
        };
        assert!((roll.abs() - std::f64::consts::PI).abs() < 1e-3 && pitch.abs() < 1e-3);
        let heavy = told(&|real| {
            let mut parameters = [0.0; 10];
            (parameters[0], parameters[3]) = (15.0, 15.0 * 0.6);
            (parameters[4], parameters[7]) = (15.0 * 0.37, 15.0 * 0.37);
            real.attach(real.tool_link(), Inertia::from_parameters(parameters));
        });
        assert!(
            matches!(heavy, Some(Remedy::Payload(mass)) if mass > 0.0),
            "{heavy:?}"
        );
    }
}
