//! Robots small enough to be solved on paper.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use nalgebra::{Point3, Vector3};
use tauscope_dynamics::{
    Data, Inertia, Model, forward_dynamics, forward_kinematics, gravity_effort, link_jacobian,
    link_pose, mass_matrix, rnea,
};

const G: f64 = 9.81;

fn link(name: &str, mass_kg: f64, com: &str, inertia: f64) -> String {
    format!(
        "<link name='{name}'><inertial><origin xyz='{com}'/><mass value='{mass_kg}'/>
         <inertia ixx='{inertia}' ixy='0' ixz='0' iyy='{inertia}' iyz='0' izz='{inertia}'/></inertial></link>"
    )
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, xyz: &str, axis: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>
         <origin xyz='{xyz}'/><axis xyz='{axis}'/></joint>"
    )
}

fn model(parts: &[String]) -> Model {
    Model::from_urdf(&format!(
        "<robot name='paper'><link name='base'/>{}</robot>",
        parts.concat()
    ))
    .unwrap()
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{found:?} is not {expected:?}");
    }
}

/// Siciliano et al., *Robotics*, 2009, section 7.3.2, with angles from the hanging position.
#[test]
fn a_double_pendulum_follows_its_closed_form() {
    let (m1, m2, l1, r1, r2, i1, i2) = (2.0, 1.5, 0.8, 0.3, 0.45, 0.07, 0.04);
    let model = model(&[
        joint("one", "continuous", "base", "upper", "0 0 1", "1 0 0"),
        link("upper", m1, "0 0 -0.3", i1),
        joint("two", "continuous", "upper", "lower", "0 0 -0.8", "1 0 0"),
        link("lower", m2, "0 0 -0.45", i2),
    ]);
    let mut data = Data::new(&model);
    for k in 0..50 {
        let x = f64::from(k);
        let q = [(0.7 * x).sin() * 3.0, (1.3 * x).cos() * 3.0];
        let qd = [(0.2 * x).cos() * 2.0, (0.9 * x).sin() * 2.0];
        let qdd = [(1.1 * x).sin() * 5.0, (0.4 * x).cos() * 5.0];
        let (s1, s12) = (q[0].sin(), (q[0] + q[1]).sin());
        let (s2, c2) = q[1].sin_cos();
        let m11 = i1 + i2 + m1 * r1 * r1 + m2 * (l1 * l1 + r2 * r2 + 2.0 * l1 * r2 * c2);
        let m12 = i2 + m2 * (r2 * r2 + l1 * r2 * c2);
        let m22 = i2 + m2 * r2 * r2;
        let h = -m2 * l1 * r2 * s2;
        let gravity = [
            m1 * G * r1 * s1 + m2 * G * (l1 * s1 + r2 * s12),
            m2 * G * r2 * s12,
        ];
        let effort = [
            m11 * qdd[0] + m12 * qdd[1] + h * (2.0 * qd[0] * qd[1] + qd[1] * qd[1]) + gravity[0],
            m12 * qdd[0] + m22 * qdd[1] - h * qd[0] * qd[0] + gravity[1],
        ];
        close(
            mass_matrix(&model, &mut data, &q).as_slice(),
            &[m11, m12, m12, m22],
        );
        close(gravity_effort(&model, &mut data, &q), &gravity);
        close(rnea(&model, &mut data, &q, &qd, &qdd), &effort);
    }
}

/// A lift that carries an arm on one side and a drawer on the other; its joints are written from the
/// outermost inwards.
fn forked_lift() -> Model {
    model(&[
        joint("drawer", "prismatic", "lift", "drawer", "0 0 0.5", "0 1 0"),
        link("drawer", 2.0, "0 0.1 0", 0.02),
        joint("arm", "continuous", "lift", "arm", "0.2 0 0", "0 2 0"),
        link("arm", 1.0, "0.4 0 0", 0.01),
        joint("hoist", "prismatic", "base", "lift", "0 0 0", "0 0 1"),
        link("lift", 5.0, "0 0 0", 0.1),
    ])
}

#[test]
fn a_forked_lift_follows_its_closed_form() {
    let model = forked_lift();
    assert!(model.joint_names().eq(["drawer", "arm", "hoist"]));
    let mut data = Data::new(&model);
    let (q, qd, qdd): ([f64; 3], _, _) = ([0.3, 0.6, 1.2], [0.5, 2.0, -1.0], [1.5, -3.0, 0.7]);
    let (sin, cos) = q[1].sin_cos();
    // Turning about +y lowers the arm's tip: its height is -0.4 sin(q).
    let (total, reach) = (8.0, 0.4);
    let height_rate2 = -reach * cos * qdd[1] + reach * sin * qd[1] * qd[1];
    let effort = [
        2.0 * qdd[0],
        (0.01 + reach * reach) * qdd[1] - reach * cos * (qdd[2] + G),
        total * (qdd[2] + G) + height_rate2,
    ];
    close(rnea(&model, &mut data, &q, &qd, &qdd), &effort);
    close(
        forward_dynamics(&model, &mut data, &q, &qd, &effort, &[]),
        &qdd,
    );
    let coupling = -reach * cos;
    close(
        mass_matrix(&model, &mut data, &q).as_slice(),
        &[
            2.0,
            0.0,
            0.0,
            0.0,
            0.01 + reach * reach,
            coupling,
            0.0,
            coupling,
            total,
        ],
    );

    forward_kinematics(&model, &mut data, &q);
    let drawer = link_pose(&model, &data, model.link_index("drawer").unwrap());
    close(drawer.translation.vector.as_slice(), &[0.0, 0.3, 1.7]);
    let arm = model.link_index("arm").unwrap();
    let tip = link_pose(&model, &data, arm) * Point3::new(0.4, 0.0, 0.0);
    close(
        tip.coords.as_slice(),
        &[0.2 + 0.4 * cos, 0.0, 1.2 - 0.4 * sin],
    );
    let jacobian = link_jacobian(&model, &mut data, arm);
    close(jacobian.column(0).as_slice(), &[0.0; 6]);
    close(
        jacobian.column(1).as_slice(),
        &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    );
    close(
        jacobian.column(2).as_slice(),
        &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    );
}

#[test]
fn gravity_and_tool_change_the_holding_effort() {
    let mut model = forked_lift();
    let mut data = Data::new(&model);
    let q = [0.0; 3];
    close(
        gravity_effort(&model, &mut data, &q),
        &[0.0, -0.4 * G, 8.0 * G],
    );
    let arm = model.link_index("arm").unwrap();
    model.set_tool(arm, Inertia::new(0.5, [0.6, 0.0, 0.0], [0.0; 6]));
    close(
        gravity_effort(&model, &mut data, &q),
        &[0.0, -0.7 * G, 8.5 * G],
    );
    // The tool moves to the drawer; a link that stands still carries it without effort.
    model.set_tool(
        model.link_index("drawer").unwrap(),
        Inertia::new(0.5, [0.0; 3], [0.0; 6]),
    );
    close(
        gravity_effort(&model, &mut data, &q),
        &[0.0, -0.4 * G, 8.5 * G],
    );
    model.set_tool(
        model.link_index("base").unwrap(),
        Inertia::new(0.5, [0.0; 3], [0.0; 6]),
    );
    model.set_gravity([0.0, -G, 0.0]);
    close(gravity_effort(&model, &mut data, &q), &[2.0 * G, 0.0, 0.0]);
}

/// Kinetic energy from the mass matrix and potential energy from the links' centres.
fn energy(model: &Model, data: &mut Data, q: &[f64], qd: &[f64]) -> f64 {
    let qd = nalgebra::DVector::from_row_slice(qd);
    let kinetic = 0.5 * (mass_matrix(model, data, q) * &qd).dot(&qd);
    forward_kinematics(model, data, q);
    let gravity = Vector3::from(model.gravity());
    let weight = |index: usize| {
        let link = &model.links()[index];
        let com = link_pose(model, data, index) * Point3::from(link.com_m());
        -link.mass_kg() * gravity.dot(&com.coords)
    };
    kinetic + (0..model.links().len()).map(weight).sum::<f64>()
}

#[test]
fn energy_is_conserved_without_effort() {
    let model = model(&[
        joint("a", "continuous", "base", "upper", "0 0 1", "1 0.2 0"),
        link("upper", 2.0, "0.1 0 -0.3", 0.05),
        joint(
            "b",
            "continuous",
            "upper",
            "lower",
            "0 0 -0.6",
            "0.3 1 -0.5",
        ),
        link("lower", 1.0, "0 0.05 -0.2", 0.02),
        joint("c", "prismatic", "upper", "slider", "0 0.1 -0.2", "1 1 0"),
        link("slider", 0.5, "0 0 0.1", 0.01),
        joint("d", "continuous", "slider", "wheel", "0.1 0 0", "0 0 1"),
        link("wheel", 0.4, "0.1 0 0.02", 0.004),
    ]);
    let mut data = Data::new(&model);
    let (n, step) = (model.dof(), 5e-4);
    let (mut q, mut qd) = (vec![1.0, -0.5, 0.1, 0.3], vec![0.5, 2.0, -0.2, 3.0]);
    let before = energy(&model, &mut data, &q, &qd);
    let mut moved = 0.0_f64;
    // Runge-Kutta of fourth order over one second.
    for _ in 0..2000 {
        let mut slope = |q: &[f64], qd: &[f64]| {
            let qdd = forward_dynamics(&model, &mut data, q, qd, &vec![0.0; n], &[]);
            (qd.to_vec(), qdd.to_vec())
        };
        let ahead = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> {
            x.iter().zip(by).map(|(x, by)| x + h * by).collect()
        };
        let k1 = slope(&q, &qd);
        let k2 = slope(
            &ahead(&q, &k1.0, step / 2.0),
            &ahead(&qd, &k1.1, step / 2.0),
        );
        let k3 = slope(
            &ahead(&q, &k2.0, step / 2.0),
            &ahead(&qd, &k2.1, step / 2.0),
        );
        let k4 = slope(&ahead(&q, &k3.0, step), &ahead(&qd, &k3.1, step));
        for j in 0..n {
            q[j] += step / 6.0 * (k1.0[j] + 2.0 * k2.0[j] + 2.0 * k3.0[j] + k4.0[j]);
            qd[j] += step / 6.0 * (k1.1[j] + 2.0 * k2.1[j] + 2.0 * k3.1[j] + k4.1[j]);
            moved = moved.max(qd[j].abs());
        }
    }
    let drift = (energy(&model, &mut data, &q, &qd) - before).abs();
    assert!(moved > 3.0, "it did move: {moved}");
    assert!(
        drift < 1e-8 * before.abs(),
        "{before} J changed by {drift} J"
    );
}
