//! N m per recorded unit, by joint: given, known from a corrected twin, or estimated from gravity.

use tauscope_dynamics::{Data, gravity_effort};

use crate::read::input::Input;
use crate::read::start::Start;

/// Ratio of a torque scale to its standard deviation above which it is used where an estimate is better than none.
/// Statistical: its 95 % interval then leaves out zero (1.96, rounded up).
const LIKELY: f64 = 2.0;
/// Smallest gravity torque of a loaded joint, relative to that of the most loaded joint.
/// Physical: friction at rest is up to about a tenth of the largest gravity torque of an arm, and dominates below.
const BEARS: f64 = 0.1;

impl Start {
    /// Returns N m per recorded unit by joint, where the gains are inverse torque constants; 1 where a gain is not
    /// identifiable.
    pub fn units_nm(&self) -> Vec<f64> {
        let of = |joint| {
            if self.is_scale_known(joint) {
                1.0 / self.gain[joint]
            } else {
                1.0
            }
        };
        (0..self.gain.len()).map(of).collect()
    }

    /// Returns the most likely N m per recorded unit by joint, where the gains are inverse torque constants. A joint
    /// whose gain is not identifiable gets the median of the others.
    pub fn likely_units_nm(&self) -> Vec<f64> {
        let gains = self.gain.iter().zip(&self.gain_deviation);
        let told = gains.map(|(gain, deviation)| (*gain > LIKELY * deviation).then(|| 1.0 / gain));
        filled(&told.collect::<Vec<_>>())
    }
}

/// Replaces the unknown scales by the median of the known ones; 1 if none is known.
fn filled(known: &[Option<f64>]) -> Vec<f64> {
    let mut told: Vec<f64> = known.iter().copied().flatten().collect();
    told.sort_by(f64::total_cmp);
    let middle = told.get(told.len() / 2).copied().unwrap_or(1.0);
    known.iter().map(|unit| unit.unwrap_or(middle)).collect()
}

/// Estimates N m per recorded unit by joint: the gravity torque of an arm at rest over the measured effort. Friction
/// bears part of the weight, so forces that depend on this are approximate.
fn units_under_gravity(input: &Input) -> Vec<f64> {
    let n = input.model.dof();
    let mut data = Data::new(&input.model);
    let (mut weight_nm, mut effort) = (vec![0.0; n], vec![0.0; n]);
    for recording in &input.fit {
        let rows = recording
            .position
            .chunks_exact(n)
            .zip(recording.effort.chunks_exact(n));
        for (position, measured) in rows {
            let gravity = gravity_effort(&input.model, &mut data, position);
            for j in 0..n {
                weight_nm[j] += gravity[j];
                effort[j] += measured[j];
            }
        }
    }
    let most_nm = weight_nm.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
    let unit = |j: usize| {
        let unit = weight_nm[j] / effort[j];
        (weight_nm[j].abs() > BEARS * most_nm && unit.is_finite() && unit > 0.0).then_some(unit)
    };
    filled(&(0..n).map(unit).collect::<Vec<_>>())
}

/// Returns N m per recorded unit by joint, and the joints where it is unknown, each with the initial gain of its fit.
pub fn scales(input: &Input, constants: &[f64], at_rest: bool) -> (Vec<f64>, Vec<(usize, f64)>) {
    if input.effort_unit != "A" || input.torque_constants_nm_per_a.is_some() {
        return (constants.to_vec(), Vec::new());
    }
    let joints = 0..constants.len();
    let Some(start) = &input.start else {
        let likely = units_under_gravity(input);
        let gains = likely.iter().map(|unit| 1.0 / unit).enumerate().collect();
        // At rest, gravity is the only source of the scale.
        let units_nm = if at_rest { likely } else { constants.to_vec() };
        return (units_nm, gains);
    };
    let unknown = joints.filter(|&j| !start.is_scale_known(j));
    let unknown = unknown.map(|j| (j, start.gain[j])).collect();
    let units_nm = if at_rest {
        start.likely_units_nm()
    } else {
        start.units_nm()
    };
    (units_nm, unknown)
}
