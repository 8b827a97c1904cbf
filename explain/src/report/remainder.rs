//! Remaining residual that a feature of the motion predicts in pieces of recordings that were left out of the fit.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::words::number;

use crate::fit::fitted::Fit;
use crate::inference::remainder::Predicted;
use crate::report::schema::Remaining;
use crate::report::sentences::unit_at;

/// Returns the remaining residuals of a fit with a sentence each. `noise` is the white noise of each joint
/// \[effort unit\], `unit_nm` are N m per effort unit, by joint.
pub fn remaining(
    model: &Model,
    fit: &Fit,
    predicted: &[Predicted],
    (noise, unit_nm, unit): (&[f64], &[f64], &str),
) -> Vec<Remaining> {
    let of = |predicted: &Predicted| {
        let j = predicted.joint;
        let joint = &model.joints()[j];
        let rms = (fit.squares[j] / fit.count[j].max(1.0)).sqrt() / unit_nm[j];
        Remaining {
            joint: joint.name.clone(),
            rms,
            holdout_rms: None,
            noise: noise[j],
            sentence: format!(
                "At joint {}, {} {} remain that depend on its {}: a function of it predicts {:.0} % of the squared residual in \
                 pieces of recordings that were left out of the fit.",
                joint.name,
                number(rms),
                unit_at(unit, joint),
                predicted.by,
                100.0 * predicted.share,
            ),
        }
    };
    predicted.iter().map(of).collect()
}
