//! Numbers of which the recordings tell nothing.

use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;

/// What the recordings tell of a number counts as nothing below this share of what is known of any body.
/// Statistical: it would make the interval narrower by half a per cent.
const LEAST_TOLD: f64 = 0.01;
/// A factor is moved by this to see which parameters follow.
/// Resolution: far above the rounding of f64, and small beside any body.
const STEP: f64 = 1e-6;
/// A parameter that moves by less than this share of the step does not follow.
/// Resolution: far above the rounding of f64.
const FOLLOWS: f64 = 1e-6;

/// By effect and parameter, whether it depends on a factor of which the recordings tell nothing: the height of a centre of
/// mass where all axes are vertical. The fit leaves it where it began, or where usual bodies have it.
pub fn untold(problem: &Problem, fit: &Fit) -> Vec<Vec<bool>> {
    let free = fit.parameters();
    let (prior, _) = body_prior::normal(&problem.model, &fit.actives, &free);
    let columns = fit.jacobian(problem);
    let is_untold = |at: usize| {
        let of_joint = |joint: usize| {
            let column = columns[at].of_joint(joint, problem.rows)?;
            let weight = &problem.weight[problem.joint_rows(joint)];
            let square: f64 = column.iter().zip(weight).map(|(x, w)| w * x * x).sum();
            Some(square / fit.variance[joint].max(f64::MIN_POSITIVE))
        };
        let told: f64 = (0..problem.joints).filter_map(of_joint).sum();
        told <= LEAST_TOLD * prior[(at, at)]
    };
    let mut all: Vec<Vec<bool>> = (fit.actives.iter())
        .map(|active| vec![false; active.parameters().len()])
        .collect();
    for (at, &(index, c)) in free.iter().enumerate() {
        if fit.is_factor(index, c) && is_untold(at) {
            let follow = followers(&fit.actives[index], c);
            for (untold, follows) in all[index].iter_mut().zip(follow) {
                *untold |= follows;
            }
        }
    }
    all
}

/// Which parameters of an effect follow a factor.
fn followers(active: &Active, c: usize) -> Vec<bool> {
    let mut moved = active.clone();
    moved.coordinates[c] += STEP;
    let both = moved.parameters().into_iter().zip(active.parameters());
    both.map(|(there, here)| (there - here).abs() > FOLLOWS * STEP)
        .collect()
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::Model;
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fixture::{URDF, problem, recording};
    use crate::physics::active::{Hypothesis, Whereabouts};

    /// Which numbers of a body on the last link the recordings of two joints about this axis do not tell.
    fn said(name: &str, axis: &str) -> Vec<(&'static str, bool)> {
        let urdf = URDF.replace("axis xyz=\"0 1 0\"", &format!("axis xyz=\"{axis}\""));
        let model = Model::from_urdf(&urdf).unwrap();
        let recordings = [1, 2].map(|seed| recording(&model, seed, |_, _, _| {}));
        let problem = problem(&model, &recordings);
        let effect = effect(name).unwrap();
        let place = Whereabouts {
            link: model.joints()[1].child_link,
            ..Whereabouts::default()
        };
        let body = Hypothesis { effect, place };
        let mut values = vec![0.0; effect.parameters.len()];
        values[0] = 0.4;
        let active = body.with((effect.to_coordinates)(&values));
        let fit = Fit::new(&problem, vec![active]);
        let untold = untold(&problem, &fit);
        let names = effect.parameters.iter().map(|parameter| parameter.name);
        names.zip(untold[0].iter().copied()).collect()
    }

    #[test]
    fn a_height_that_no_joint_feels_is_not_told() {
        let upright = said("link_com", "0 0 1");
        assert_eq!(
            upright,
            [
                ("delta_com_x_m", false),
                ("delta_com_y_m", false),
                ("delta_com_z_m", true)
            ]
        );
    }

    #[test]
    fn what_gravity_shows_is_told() {
        let lying = said("link_com", "0 1 0");
        assert!(lying.contains(&("delta_com_z_m", false)), "{lying:?}");
        assert!(lying.contains(&("delta_com_y_m", true)), "{lying:?}");
    }
}
