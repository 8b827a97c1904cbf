//! Agrees with Pinocchio on every value of `../shared/reference`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde_json::Value;
use tauscope_dynamics::{
    Data, Model, forward_kinematics, gravity_effort, link_jacobian, link_pose, mass_matrix,
    regressor, rnea,
};

/// Relative to the largest number of what is compared.
const TOLERANCE: f64 = 1e-9;

#[test]
fn every_value_agrees_with_pinocchio() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if !shared.is_dir() {
        eprintln!("SKIPPED every_value_agrees_with_pinocchio: ../shared is absent");
        return;
    }
    let mut files: Vec<PathBuf> = std::fs::read_dir(shared.join("reference"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ext| ext == "json"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    for file in files {
        let reference: Value =
            serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
        let urdf = shared
            .join("robots")
            .join(reference["urdf"].as_str().unwrap());
        let model = Model::from_urdf(&std::fs::read_to_string(&urdf).unwrap()).unwrap();
        let worst = compare(&model, &reference);
        eprintln!(
            "{}: largest relative difference {worst:.1e}",
            file.display()
        );
        assert!(worst < TOLERANCE);
    }
}

fn compare(model: &Model, reference: &Value) -> f64 {
    let names = reference["joints"].as_array().unwrap();
    assert!(
        model
            .joint_names()
            .eq(names.iter().map(|name| name.as_str().unwrap()))
    );
    assert_eq!(model.gravity().to_vec(), numbers(&reference["gravity"]));
    let tip = model
        .link_index(reference["tip_link"].as_str().unwrap())
        .unwrap();
    let parameters: Vec<f64> = (0..model.dof())
        .flat_map(|j| model.body_parameters(j))
        .collect();
    let parameters = nalgebra::DVector::from_vec(parameters);
    let mut data = Data::new(model);
    let mut worst = 0.0_f64;
    for sample in reference["samples"].as_array().unwrap() {
        let [q, qd, qdd] =
            ["position", "velocity", "acceleration"].map(|key| numbers(&sample[key]));
        let mut check = |key: &str, found: &[f64]| {
            let expected = flatten(&sample[key]);
            assert_eq!(found.len(), expected.len(), "{key}");
            let scale = expected.iter().fold(0.0_f64, |scale, x| scale.max(x.abs()));
            for (found, expected) in found.iter().zip(expected) {
                worst = worst.max((found - expected).abs() / scale);
            }
        };
        check("effort", rnea(model, &mut data, &q, &qd, &qdd));
        check("gravity", gravity_effort(model, &mut data, &q));
        check("mass_matrix", mass_matrix(model, &mut data, &q).as_slice());
        check(
            "effort",
            (regressor(model, &mut data, &q, &qd, &qdd) * &parameters).as_slice(),
        );
        forward_kinematics(model, &mut data, &q);
        let position: Vector3<f64> = link_pose(model, &data, tip).translation.vector;
        check("tip_position", position.as_slice());
        // nalgebra stores columns, the reference rows.
        check(
            "tip_jacobian",
            link_jacobian(model, &mut data, tip).transpose().as_slice(),
        );
    }
    worst
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn flatten(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(parts) => parts.iter().flat_map(flatten).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}
