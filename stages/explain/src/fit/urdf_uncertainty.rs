//! Error of a fit's numbers from errors of the URDF's masses and centres of mass.

use std::sync::Arc;

use tauscope_dynamics::terms::EFFECTS;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::{Products, solved};
use crate::physics::active::{Hypothesis, Whereabouts};

/// What a usual error of each number of the URDF's bodies adds to the efforts: one standard deviation of each link's mass
/// and centre of mass (`off_in_urdf` of the effects).
pub fn usual_errors(problem: &Problem, fit: &Fit) -> Vec<Arc<Column>> {
    let model = &problem.model;
    let mut errors = Vec::new();
    for joint in 0..model.dof() {
        let body = model.body_link(joint);
        let (link, place) = (
            &model.links()[body],
            Whereabouts {
                link: body,
                ..Whereabouts::default()
            },
        );
        for (effect, off) in EFFECTS
            .iter()
            .filter_map(|effect| Some((*effect, effect.traits.off_in_urdf?(link))))
        {
            let shape = vec![0.0; effect.coordinates.len()];
            let all = fit.columns(problem, Hypothesis { effect, place }, &shape);
            errors.extend(all.factors.iter().map(|column| {
                Arc::new(Column {
                    joint: column.joint,
                    values: column.values.iter().map(|value| off * value).collect(),
                })
            }));
        }
    }
    errors
}

/// Standard deviation of each coordinate of a fit from usual errors of the URDF's bodies: the root of the sum of squares
/// over all links. Without it, the torque scale of a joint that carries next to nothing would have too small an interval.
pub fn off_with_the_links(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let errors = usual_errors(problem, fit);
    let own = fit.jacobian(problem);
    let p = own.len();
    let all: Vec<&Column> = own.iter().chain(&errors).map(AsRef::as_ref).collect();
    let products = Products::new(problem, &all, &fit.residual, None);
    let (normal, _) = products.normal(&fit.variance, &vec![0.0; all.len()]);
    let mine = normal.view((0, 0), (p, p)).into_owned();
    let mut squares = vec![0.0; p];
    for k in p..all.len() {
        let right = normal.view((0, k), (p, 1)).column(0).into_owned();
        if let Some(off) = solved(&mine, &right, &vec![true; p], 0.0) {
            for (sum, off) in squares.iter_mut().zip(off.iter()) {
                *sum += off * off;
            }
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}
