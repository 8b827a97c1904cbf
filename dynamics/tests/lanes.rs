//! Four samples at once, against the same samples one by one.

use nalgebra::SimdValue;
use proptest::prelude::*;
use tauscope_dynamics::{
    Data, Lanes, Model, forward_kinematics, gravity_effort, gravity_rows, link_jacobian,
    mass_matrix, regressor, rnea, rnea_rows,
};

mod robots;
use robots::robot_in_motion;

/// Largest difference between a lane and the sample on its own, relative to the largest value. Statistical: some hundred
/// roundings.
const ROUNDING: f64 = 1e-12;

/// Four motions from one, and their lanes.
fn spread(values: &[f64]) -> (Vec<Vec<f64>>, Vec<Lanes>) {
    let scale = |lane: usize| 1.0 - 0.3 * lane as f64;
    let of_lane = |lane| values.iter().map(|value| value * scale(lane)).collect();
    let samples: Vec<Vec<f64>> = (0..Lanes::LANES).map(of_lane).collect();
    let joint = |j: usize| Lanes::from([0, 1, 2, 3].map(|lane| samples[lane][j]));
    let lanes = (0..values.len()).map(joint).collect();
    (samples, lanes)
}

fn near(found: &[f64], wanted: &[f64]) -> bool {
    let largest = wanted
        .iter()
        .fold(1.0, |most: f64, value| most.max(value.abs()));
    let mut pairs = found.iter().zip(wanted);
    found.len() == wanted.len() && pairs.all(|(a, b)| (a - b).abs() <= ROUNDING * largest)
}

/// Whether `lanes` are four times `wanted` of the samples.
fn agree(lanes: &[Lanes], wanted: &mut dyn FnMut(usize) -> Vec<f64>) -> bool {
    (0..Lanes::LANES).all(|lane| {
        let found: Vec<f64> = lanes.iter().map(|joint| joint.extract(lane)).collect();
        near(&found, &wanted(lane))
    })
}

fn memory(model: &Model) -> (Data, Data<Lanes>) {
    (Data::new(model), Data::new(model))
}

proptest! {
    #[test]
    fn each_lane_is_its_sample((model, [q, qd, qdd]) in robot_in_motion()) {
        let (mut one, mut four) = memory(&model);
        let (q, q4) = spread(&q);
        let (qd, qd4) = spread(&qd);
        let (qdd, qdd4) = spread(&qdd);

        let found = rnea(&model, &mut four, &q4, &qd4, &qdd4);
        let mut wanted = |k: usize| rnea(&model, &mut one, &q[k], &qd[k], &qdd[k]).to_vec();
        prop_assert!(agree(found, &mut wanted), "effort");

        let found = gravity_effort(&model, &mut four, &q4);
        let mut wanted = |k: usize| gravity_effort(&model, &mut one, &q[k]).to_vec();
        prop_assert!(agree(found, &mut wanted), "gravity");

        let found = regressor(&model, &mut four, &q4, &qd4, &qdd4).as_slice();
        let mut wanted =
            |k: usize| regressor(&model, &mut one, &q[k], &qd[k], &qdd[k]).as_slice().to_vec();
        prop_assert!(agree(found, &mut wanted), "regressor");

        let found = mass_matrix(&model, &mut four, &q4).as_slice();
        let mut wanted = |k: usize| mass_matrix(&model, &mut one, &q[k]).as_slice().to_vec();
        prop_assert!(agree(found, &mut wanted), "mass matrix");

        let rows = rnea_rows(&model, &q.concat(), &qd.concat(), &qdd.concat());
        let wanted = (0..4).map(|k| rnea(&model, &mut one, &q[k], &qd[k], &qdd[k]).to_vec());
        prop_assert!(near(&rows, &wanted.collect::<Vec<_>>().concat()), "rows");
        // Rows that do not fill a batch.
        let rows = gravity_rows(&model, &q[1..].concat());
        let wanted = (1..4).map(|k| gravity_effort(&model, &mut one, &q[k]).to_vec());
        prop_assert!(near(&rows, &wanted.collect::<Vec<_>>().concat()), "rows of positions");

        let tip = model.links().len() - 1;
        forward_kinematics(&model, &mut four, &q4);
        let found = link_jacobian(&model, &mut four, tip).as_slice();
        let mut wanted = |k: usize| {
            forward_kinematics(&model, &mut one, &q[k]);
            link_jacobian(&model, &mut one, tip).as_slice().to_vec()
        };
        prop_assert!(agree(found, &mut wanted), "Jacobian");
    }
}
