//! Error of a fit's numbers from errors of the URDF's masses and centres of mass.

use std::sync::Arc;

use nalgebra::DVector;
use tauscope_dynamics::terms::EFFECTS;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::{Products, solved};
use crate::physics::active::{Hypothesis, Whereabouts};

/// Standard deviation of each coordinate of a fit from errors of the URDF's masses and centres of mass: the root of the
/// sum of squares over all links. Without it, the torque scale of a joint that carries next to nothing would have too
/// small an interval.
pub fn off_with_the_links(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let model = &problem.model;
    let mut nuisance: Vec<Arc<Column>> = Vec::new();
    let mut size: Vec<f64> = Vec::new();
    for joint in model.joints() {
        let (link, place) = (
            &model.links()[joint.child_link],
            Whereabouts {
                link: joint.child_link,
                ..Whereabouts::default()
            },
        );
        for (effect, off) in EFFECTS
            .iter()
            .filter_map(|effect| Some((*effect, effect.traits.off_in_urdf?(link))))
        {
            let shape = vec![0.0; effect.coordinates.len()];
            let all = fit.columns(problem, Hypothesis { effect, place }, &shape);
            size.extend(all.factors.iter().map(|_| off));
            nuisance.extend(all.factors.iter().cloned());
        }
    }
    let own = fit.jacobian(problem);
    let p = own.len();
    let all: Vec<&Column> = own.iter().chain(&nuisance).map(AsRef::as_ref).collect();
    let products = Products::new(problem, &all, &fit.residual, None);
    let (normal, _) = products.normal(&fit.variance, &vec![0.0; all.len()]);
    let mine = normal.view((0, 0), (p, p)).into_owned();
    let mut squares = vec![0.0; p];
    for (k, size) in size.iter().enumerate() {
        let right = DVector::from_iterator(p, (0..p).map(|a| normal[(a, p + k)] * size));
        if let Some(off) = solved(&mine, &right, &vec![true; p], 0.0) {
            for (sum, off) in squares.iter_mut().zip(off.iter()) {
                *sum += off * off;
            }
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}
