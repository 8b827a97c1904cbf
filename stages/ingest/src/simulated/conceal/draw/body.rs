//! Bodies, and what acts on them.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use tauscope_dynamics::{Data, forward_kinematics, link_pose};

use super::{Drawn, Parameters, Plan, Site, between, drawn};

/// Radius of gyration of a payload \[m\].
const PAYLOAD_RADIUS_M: f64 = 0.04;
/// A URDF is off by at most this share of a link's mass, and by this in its centre \[m\].
const MOST_OF_MASS: f64 = 0.6;
const MOST_SHIFT_M: f64 = 0.06;

/// What a body, a tilt or a force of that name may be.
pub(super) fn body(name: &str, plan: &Plan, site: &Site, rng: &mut ChaCha8Rng) -> Option<Drawn> {
    let direction: [f64; 3] = UnitSphere.sample(rng);
    let shortest_s = plan.shortest_s();
    let along = move |names: [&'static str; 3], size: f64| -> Parameters {
        names.into_iter().zip(direction.map(|d| d * size)).collect()
    };
    match name {
        "payload" | "payload_pickup" => {
            let com = [
                between(rng, -0.04, 0.04),
                between(rng, -0.04, 0.04),
                between(rng, 0.03, 0.12),
            ];
            let window = (name == "payload_pickup").then(|| {
                [
                    shortest_s * between(rng, 0.2, 0.4),
                    shortest_s * between(rng, 0.6, 0.85),
                ]
            });
            drawn([1e-3, 10.0], move |mass| {
                let inertia = mass * PAYLOAD_RADIUS_M * PAYLOAD_RADIUS_M;
                let mut all = vec![
                    ("mass_kg", mass),
                    ("com_x_m", com[0]),
                    ("com_y_m", com[1]),
                    ("com_z_m", com[2]),
                    ("ixx_kgm2", inertia),
                    ("iyy_kgm2", inertia),
                    ("izz_kgm2", inertia),
                ];
                if let Some([start, end]) = window {
                    all.extend([("t_start_s", start), ("t_end_s", end)]);
                }
                all
            })
        }
        "link_mass" => {
            let most = MOST_OF_MASS * plan.model.links()[site.link].mass_kg();
            drawn([1e-3 * most, most], |mass| vec![("delta_mass_kg", mass)])
        }
        "link_com" => drawn([1e-4, MOST_SHIFT_M], move |shift| {
            along(["delta_com_x_m", "delta_com_y_m", "delta_com_z_m"], shift)
        }),
        "base_tilt" => {
            let (sin, cos) = between(rng, 0.0, TAU).sin_cos();
            drawn([1e-3, 0.3], move |angle| {
                vec![("roll_rad", angle * cos), ("pitch_rad", angle * sin)]
            })
        }
        "external_push" => {
            let start = plan.starts_s[site.recording] + shortest_s * between(rng, 0.15, 0.6);
            let end = start + shortest_s * between(rng, 0.12, 0.25);
            drawn([0.1, 100.0], move |force| {
                let mut all = along(["force_x_n", "force_y_n", "force_z_n"], force);
                all.extend([("t_start_s", start), ("t_end_s", end)]);
                all
            })
        }
        "contact_wall" => {
            let offset = wall_offset(plan, direction)?;
            drawn([10.0, 5000.0], move |stiffness| {
                let mut all = along(["normal_x", "normal_y", "normal_z"], 1.0);
                all.extend([("stiffness_n_per_m", stiffness), ("offset_m", offset)]);
                all
            })
        }
        _ => None,
    }
}

/// How far away a wall is that the arm is in for a fifth of the time \[m\]; `None` if it begins in it.
fn wall_offset(plan: &Plan, normal: [f64; 3]) -> Option<f64> {
    let n = plan.joints.len();
    let tool = &plan.model.links()[plan.model.tool_link()];
    let link = plan.model.joints()[tool.joint?].child_link;
    let mut data = Data::new(&plan.model);
    let along = plan.instants.iter().map(|instant| {
        forward_kinematics(&plan.model, &mut data, &instant.target.position[..n]);
        let place = link_pose(&plan.model, &data, link).translation.vector;
        (0..3).map(|k| normal[k] * place[k]).sum::<f64>()
    });
    let along: Vec<f64> = along.collect();
    let mut sorted = along.clone();
    sorted.sort_by(f64::total_cmp);
    let offset = *sorted.get(sorted.len() * 4 / 5)?;
    let begins_in_it = |(instant, along): (&super::super::plan::Instant, &f64)| {
        instant.recording_s == 0.0 && *along > offset
    };
    let possible = !plan.instants.iter().zip(&along).any(begins_in_it);
    possible.then_some(offset)
}
