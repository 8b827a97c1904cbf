//! Detection of efforts in another unit, with a common scale error, or with wrong torque constants.

use tauscope_dynamics::effort_scale::EffortScale;

use super::{Remedy, Slip};
use crate::read::input::Input;

/// Largest ratio of a joint's slope to the median slope, in either direction, for the joints to have a common scale.
/// Physical: masses of published URDFs are within a tenth of the real ones, and a gravity torque sums several.
const SAME: f64 = 1.2;
/// Stricter bound in place of [`SAME`] for a scale near 1, which a body missing in the URDF could also explain.
/// Physical: a payload increases the load of each joint by a different fraction.
const SAME_NEAR_1: f64 = 1.1;
/// Smallest ratio of a common scale to 1, in either direction, that is not explained by wrong masses.
/// Physical: as [`SAME`]; the masses of an arm are not all wrong by a third in the same direction.
const OFF: f64 = 1.4;
/// Minimum number of joints for a common scale.
/// Physical: the factor of a single joint may be a fault of its drive.
const LEAST_JOINTS: usize = 2;
/// Smallest ratio of measured to required torque, at every joint, of an effort relative to a rating.
/// Physical: per mille of ratings up to 333 N m, and per cent of ratings up to 33 N m, are above it.
const LEAST_RATING: f64 = 3.0;
/// Bound in place of [`LEAST_RATING`] if fewer than [`LEAST_JOINTS_NEAR_1`] joints are informative.
/// Physical: no arm carries ten times its own weight.
const RATING_OF_FEW: f64 = 10.0;
/// Minimum number of joints for a common scale near 1, which a wrong body could also explain.
/// Physical: a wrong mass of the last link can load two joints by the same factor.
const LEAST_JOINTS_NEAR_1: usize = 3;

/// Returns the fault of the efforts' scale, from the slope of measured over required effort by informative joint.
pub fn of_scale(input: &Input, slopes: &[(usize, f64)]) -> Option<Slip> {
    let mut sorted: Vec<f64> = slopes.iter().map(|(_, slope)| *slope).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = *sorted.get(sorted.len() / 2)?;
    let off = |from: f64| move |slope: &f64| (slope / from).ln().abs();
    let is_same = |within: f64| sorted.iter().map(off(middle)).all(|x| x < within.ln());
    let common = is_same(SAME) && sorted.len() >= LEAST_JOINTS;
    let scale = EffortScale::of_positive(&sorted);
    let wrong = matches!(
        scale,
        EffortScale::Current { .. } | EffortScale::TooLarge { .. }
    );
    // Within a factor of 3 of 1 a wrong body could explain the scale, so more joints must agree more closely.
    let is_off = off(1.0)(&middle) > OFF.ln();
    let near_1 = is_off && sorted.len() >= LEAST_JOINTS_NEAR_1 && is_same(SAME_NEAR_1);
    let common_off = common && (wrong || near_1);
    let in_amperes = input.effort_unit == "A";
    let remedy = match (in_amperes, input.torque_constants_nm_per_a.is_some()) {
        // Declared as a current, but the slope is that of a torque in N m.
        (true, false) => (common && !is_off).then_some(Remedy::IsTorque),
        (true, true) if common_off => Some(Remedy::ConstantsScaled(1.0 / middle)),
        (true, true) => wrong.then_some(Remedy::ConstantsWrong),
        (false, _) if common_off => Some(Remedy::EffortScaled(middle)),
        (false, _) => match scale {
            EffortScale::Current { .. } => Some(Remedy::IsCurrent),
            EffortScale::TooLarge { .. } => of_rating(&sorted).then_some(Remedy::IsOfRating),
            _ => None,
        },
    };
    remedy.map(|remedy| Slip {
        remedy,
        mended: Vec::new(),
        share: 1.0 - (1.0 - (middle - 1.0).abs().min(1.0)).powi(2),
        slopes: slopes.to_vec(),
    })
}

/// Whether these slopes, in ascending order, are those of efforts relative to ratings: each far above 1.
fn of_rating(sorted: &[f64]) -> bool {
    let least = if sorted.len() < LEAST_JOINTS_NEAR_1 {
        RATING_OF_FEW
    } else {
        LEAST_RATING
    };
    sorted.first().is_some_and(|slope| *slope > least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::model;

    /// Returns the fault of efforts in `unit` with these slopes, with torque constants or without.
    fn wrong(unit: &str, has_constants: bool, slopes: &[f64]) -> Option<Remedy> {
        let input = Input {
            case: String::new(),
            model: model(),
            bodies: true,
            effort_unit: unit.to_owned(),
            torque_constants_nm_per_a: has_constants.then(|| vec![9.0; slopes.len()]),
            fit: Vec::new(),
            holdout: Vec::new(),
            start: None,
            without: std::collections::BTreeSet::new(),
        };
        let slopes: Vec<(usize, f64)> = slopes.iter().copied().enumerate().collect();
        of_scale(&input, &slopes).map(|slip| slip.remedy)
    }

    #[test]
    fn a_torque_as_required_and_a_current_that_is_said_to_be_one_are_right() {
        assert_eq!(wrong("Nm", false, &[0.93, 1.0, 1.08]), None);
        assert_eq!(wrong("Nm", false, &[0.7, 1.0, 1.0]), None);
        assert_eq!(wrong("A", true, &[0.93, 1.0, 1.08]), None);
        // The published torque constants of a UR10e.
        assert_eq!(
            wrong("A", false, &[1.0 / 10.7, 1.0 / 8.46, 1.0 / 9.0]),
            None
        );
        assert_eq!(wrong("Nm", false, &[]), None);
    }

    #[test]
    fn a_load_that_weighs_more_on_one_joint_than_on_another_is_no_unit() {
        assert_eq!(wrong("Nm", false, &[1.29, 1.52, 1.81]), None);
        assert_eq!(
            wrong("Nm", false, &[1.5, 1.52, 1.56]),
            Some(Remedy::EffortScaled(1.52))
        );
    }

    #[test]
    fn a_unit_that_was_mistaken_is_told() {
        assert_eq!(
            wrong("A", false, &[1.15, 1.05, 1.0]),
            Some(Remedy::IsTorque)
        );
        assert_eq!(
            wrong("Nm", false, &[0.05, 0.12, 0.09]),
            Some(Remedy::IsCurrent)
        );
        assert_eq!(
            wrong("Nm", false, &[101.0, 99.0, 100.0]),
            Some(Remedy::EffortScaled(100.0))
        );
    }

    #[test]
    fn per_mille_of_what_each_joint_is_rated_for_is_told() {
        let slopes = [12.0, 3.6, 8.1, 25.0];
        assert_eq!(wrong("Nm", false, &slopes), Some(Remedy::IsOfRating));
        // One joint is as required, so a body is wrong.
        assert_eq!(wrong("Nm", false, &[12.0, 1.1, 8.1, 25.0]), None);
    }

    #[test]
    fn torque_constants_that_are_wrong_are_told_with_their_factor_if_they_share_one() {
        assert_eq!(
            wrong("A", true, &[0.19, 0.2, 0.21]),
            Some(Remedy::ConstantsScaled(5.0))
        );
        assert_eq!(
            wrong("A", true, &[0.05, 0.2, 0.3]),
            Some(Remedy::ConstantsWrong)
        );
    }
}
