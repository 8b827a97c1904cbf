//! What would make efforts fit that do not fit the robot: each remedy of a short list is tried on the data.

mod trial;

use crate::data::problem::Problem;

use trial::Trial;

/// A joint fits badly if the twin leaves at least this share of the variance that friction leaves. A twin that only lacks
/// physics leaves less, and where it leaves more no remedy makes it good.
/// Tuned: by hand, on no recorded seeds; not swept.
const BAD: f64 = 0.5;
/// A remedy makes a joint good if it leaves at most this share.
/// Tuned: by hand, on no recorded seeds; not swept.
const GOOD: f64 = 0.1;

/// What makes the efforts fit.
#[derive(Debug, Clone, PartialEq)]
pub enum Remedy {
    /// The base is turned: roll and pitch \[rad\], as in `base_tilt`.
    BaseTurned([f64; 2]),
    /// The tool carries so much \[kg\].
    Payload(f64),
    /// The efforts of two joints are swapped.
    Swapped(usize, usize),
    /// The effort of a joint has the other sign.
    EffortTurned(usize),
    /// The position of a joint counts the other way, and its effort with it.
    JointTurned(usize),
    /// The positions of joints that turn are in degrees.
    Degrees,
}

impl Remedy {
    /// Whether it is physics that the search can name, and no fault of the recording.
    pub fn is_physics(&self) -> bool {
        matches!(self, Self::BaseTurned(_) | Self::Payload(_))
    }

    /// Why nothing can be said, and what to do. `left` are the shares of variance that are left without and with it.
    pub fn reason(&self, joints: &[String], left: [f64; 2]) -> String {
        let cure = match self {
            Self::BaseTurned([roll, pitch]) => {
                format!("the base is turned: roll {roll:.2} rad, pitch {pitch:.2} rad")
            }
            Self::Payload(mass) => format!("the tool carries {mass:.1} kg"),
            Self::Swapped(a, b) => format!(
                "the efforts of {} and {} are swapped: exchange them in the driver",
                joints[*a], joints[*b]
            ),
            Self::EffortTurned(j) => format!(
                "the effort of {} has the other sign: turn it in the driver",
                joints[*j]
            ),
            Self::JointTurned(j) => format!(
                "{} counts the other way than in the URDF: turn its axis there, or position and effort in the driver",
                joints[*j]
            ),
            Self::Degrees => "the positions are in degrees: convert them to rad".to_owned(),
        };
        format!(
            "the efforts do not follow this robot's motion, which leaves {:.0} % of their variance, but would with one \
             change, which leaves {:.1} %: {cure}",
            100.0 * left[0],
            100.0 * left[1]
        )
    }
}

/// The remedy that makes a bad fit good, with the shares of variance that are left without and with it.
pub fn remedy(problem: &Problem) -> Option<(Remedy, [f64; 2])> {
    let trial = Trial::new(problem);
    let own = trial.left(&trial.own, |j| (j, 1.0));
    if !own.iter().any(|left| *left > BAD) {
        return None;
    }
    let worst = |left: &[f64]| left.iter().copied().fold(0.0, f64::max);
    let mut best: Option<(Remedy, [f64; 2], f64)> = None;
    let mut consider = |remedy: Remedy, left: &[f64]| {
        if worst(left) > GOOD {
            return;
        }
        let evidence: f64 = left.iter().map(|left| -left.max(1e-9).ln()).sum();
        if best.as_ref().is_none_or(|(_, _, most)| evidence > *most) {
            best = Some((remedy, [worst(&own), worst(left)], evidence));
        }
    };
    let n = problem.joints;
    for a in 0..n {
        for b in a + 1..n {
            let swap = |j: usize| {
                if j == a {
                    b
                } else if j == b {
                    a
                } else {
                    j
                }
            };
            consider(
                Remedy::Swapped(a, b),
                &trial.left(&trial.own, |j| (swap(j), 1.0)),
            );
        }
        let sign = |j: usize| if j == a { -1.0 } else { 1.0 };
        consider(
            Remedy::EffortTurned(a),
            &trial.left(&trial.own, |j| (j, sign(j))),
        );
        let turned = trial.moved(sign);
        consider(
            Remedy::JointTurned(a),
            &trial.left(&turned, |j| (j, sign(j))),
        );
    }
    let in_degrees = trial.moved(|_| std::f64::consts::PI / 180.0);
    consider(Remedy::Degrees, &trial.left(&in_degrees, |j| (j, 1.0)));
    if let Some((turn, left)) = trial.base_turned() {
        consider(Remedy::BaseTurned(turn), &left);
    }
    if let Some((mass, left)) = trial.payload() {
        consider(Remedy::Payload(mass), &left);
    }
    best.map(|(remedy, left, _)| (remedy, left))
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::{Inertia, Model};

    use super::*;
    use crate::fixture::{self, Noise};

    /// The remedy for two recordings of the small arm that `spoil` has changed.
    fn remedy_of(spoil: impl Fn(&mut crate::read::recording::Recording)) -> Option<Remedy> {
        let model = fixture::model();
        let mut noise = Noise(7);
        let recordings = [4, 5].map(|seed| {
            let mut recording = fixture::recording(&model, seed, |_, qd, effort| {
                effort[0] += 2.0 * qd[0].signum() + 0.05 * noise.next();
                effort[1] += 0.05 * noise.next();
            });
            spoil(&mut recording);
            recording
        });
        remedy(&fixture::problem(&model, &recordings)).map(|(remedy, _)| remedy)
    }

    #[test]
    fn what_fits_needs_no_remedy() {
        assert_eq!(remedy_of(|_| {}), None);
    }

    #[test]
    fn swapped_efforts_a_turned_sign_a_turned_joint_and_degrees_are_told() {
        let swapped = remedy_of(|recording| {
            recording
                .effort
                .chunks_mut(2)
                .for_each(|row| row.swap(0, 1));
        });
        assert_eq!(swapped, Some(Remedy::Swapped(0, 1)));
        let turned = |of: usize, also_position: bool| {
            remedy_of(move |recording| {
                for row in recording.effort.chunks_mut(2) {
                    row[of] = -row[of];
                }
                if also_position {
                    for all in [&mut recording.position, &mut recording.velocity] {
                        all.chunks_mut(2).for_each(|row| row[of] = -row[of]);
                    }
                }
            })
        };
        assert_eq!(turned(1, false), Some(Remedy::EffortTurned(1)));
        // Seen in a mirror, this arm with one joint turned is the one with the other turned.
        assert!(matches!(turned(0, true), Some(Remedy::JointTurned(_))));
        let degrees = remedy_of(|recording| {
            for all in [&mut recording.position, &mut recording.velocity] {
                for x in all.iter_mut() {
                    *x = x.to_degrees();
                }
            }
        });
        assert_eq!(degrees, Some(Remedy::Degrees));
    }

    #[test]
    fn a_turned_base_and_a_heavy_payload_are_physics_with_their_numbers() {
        let told = |change: &dyn Fn(&mut Model)| {
            let model = fixture::model();
            let mut real = model.clone();
            change(&mut real);
            let recordings = [4, 5].map(|seed| fixture::recording(&real, seed, |_, _, _| {}));
            remedy(&fixture::problem(&model, &recordings)).map(|(remedy, _)| remedy)
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
