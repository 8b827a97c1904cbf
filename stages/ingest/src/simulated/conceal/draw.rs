//! What an effect may look like: places and shapes at random, and the sizes among which one is sought.

mod body;

use std::f64::consts::{PI, TAU};

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use tauscope_dynamics::terms::TermSpec;
use tauscope_dynamics::{Data, mass_matrix};

use super::fit_count;
use super::plan::Plan;

use body::body;

/// Every effect that is drawn.
pub(super) const DRAWN: &[&str] = &[
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "asymmetric_coulomb",
    "load_dependent_friction",
    "presliding_hysteresis",
    "quadratic_drag",
    "temperature_viscous",
    "friction_step",
    "rotor_inertia",
    "torque_gain",
    "torque_bias",
    "transmission_coupling",
    "counterbalance_spring",
    "cable_spring",
    "torque_ripple",
    "payload",
    "link_mass",
    "link_com",
    "base_tilt",
    "external_push",
    "contact_wall",
    "payload_pickup",
    "torque_delay",
    "torque_lowpass",
    "torque_saturation",
    "joint_elasticity",
    "backlash",
];

/// The share of the motor's effort that friction and springs may take.
const LARGEST_SHARE: f64 = 0.4;
/// No joint warms up faster \[s\].
const FASTEST_WARM_UP_S: f64 = 3.2;

type Parameters = Vec<(&'static str, f64)>;

/// An effect at a place, of any size.
pub(super) struct Candidate {
    place: TermSpec,
    parameters: Box<dyn Fn(f64) -> Parameters>,
    /// Least and largest.
    pub sizes: [f64; 2],
}

impl Candidate {
    /// The term of this size.
    pub fn term(&self, size: f64) -> TermSpec {
        let parameters = (self.parameters)(size).into_iter();
        TermSpec {
            parameters: parameters
                .map(|(name, value)| (name.to_owned(), rounded(value)))
                .collect(),
            ..self.place.clone()
        }
    }
}

/// To four digits.
pub(super) fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let digits = 10.0_f64.powi(3 - value.abs().log10().floor() as i32);
    (value * digits).round() / digits
}

/// A random number between two.
fn between(rng: &mut ChaCha8Rng, least: f64, most: f64) -> f64 {
    least + (most - least) * rng.random::<f64>()
}

/// An effect at a random place; `None` where that place is impossible.
pub(super) fn candidate(
    name: &'static str,
    plan: &Plan,
    rng: &mut ChaCha8Rng,
) -> Option<Candidate> {
    let site = Site::draw(plan, rng)?;
    let at = site.place(name, plan);
    let (parameters, sizes) = friction(name, plan, &site, rng)
        .or_else(|| spring(name, plan, &site, rng))
        .or_else(|| body(name, plan, &site, rng))
        .or_else(|| record(name, plan, &site, rng))?;
    Some(Candidate {
        place: at,
        parameters,
        sizes,
    })
}

type Drawn = (Box<dyn Fn(f64) -> Parameters>, [f64; 2]);

fn drawn(sizes: [f64; 2], parameters: impl Fn(f64) -> Parameters + 'static) -> Option<Drawn> {
    let possible = sizes[0] > 0.0 && sizes[0] < sizes[1] && sizes[1].is_finite();
    possible.then(|| (Box::new(parameters) as Box<_>, sizes))
}

/// A joint, its neighbour, and a link that moves.
struct Site {
    joint: usize,
    source: usize,
    link: usize,
    /// A recording that may be fitted.
    recording: usize,
}

impl Site {
    fn draw(plan: &Plan, rng: &mut ChaCha8Rng) -> Option<Self> {
        let n = plan.joints.len();
        if n == 0 || plan.durations_s.is_empty() {
            return None;
        }
        let joint = rng.random_range(0..n);
        let next = joint + 1 < n && (joint == 0 || rng.random::<bool>());
        let of_link = rng.random_range(0..n);
        Some(Self {
            joint,
            source: if next {
                joint + 1
            } else {
                joint.saturating_sub(1)
            },
            link: plan.model.joints()[of_link].child_link,
            recording: rng.random_range(0..fit_count(plan.durations_s.len())),
        })
    }

    fn place(&self, name: &str, plan: &Plan) -> TermSpec {
        let joint = |j: usize| Some(plan.joints[j].name.clone());
        let mut spec = TermSpec {
            effect: name.to_owned(),
            ..TermSpec::default()
        };
        match name {
            "link_mass" | "link_com" | "external_push" => {
                spec.link = Some(plan.model.links()[self.link].name.clone());
            }
            "payload" | "payload_pickup" | "contact_wall" | "base_tilt" | "torque_delay"
            | "torque_lowpass" => {}
            "transmission_coupling" => {
                spec.joint = joint(self.joint);
                spec.source_joint = joint(self.source);
            }
            _ => spec.joint = joint(self.joint),
        }
        spec
    }
}

fn friction(name: &str, plan: &Plan, site: &Site, rng: &mut ChaCha8Rng) -> Option<Drawn> {
    let j = site.joint;
    let most = LARGEST_SHARE * plan.motor_nm[j];
    // Sizes are efforts at the fastest motion unless said otherwise.
    let efforts = [1e-4 * most, most];
    let v = plan.fastest[j];
    if v <= 0.0 {
        return None;
    }
    let share = rng.random::<f64>();
    match name {
        "viscous_friction" => drawn(efforts, move |f| vec![("viscous_nms_per_rad", f / v)]),
        "coulomb_friction" => drawn(efforts, |f| vec![("coulomb_nm", f)]),
        "quadratic_drag" => drawn(efforts, move |f| vec![("drag_nms2_per_rad2", f / (v * v))]),
        "stribeck_friction" => {
            let (more, speed) = (1.5 + share, v * between(rng, 0.04, 0.12));
            drawn(efforts, move |f| {
                vec![
                    ("coulomb_nm", f),
                    ("static_nm", f * more),
                    ("stribeck_velocity_rad_s", speed),
                ]
            })
        }
        "asymmetric_coulomb" => {
            let (mut forward, mut back) = (1.0, 0.3 + 0.4 * share);
            if rng.random::<bool>() {
                std::mem::swap(&mut forward, &mut back);
            }
            drawn(efforts, move |f| {
                vec![
                    ("coulomb_positive_nm", f * forward),
                    ("coulomb_negative_nm", f * back),
                ]
            })
        }
        "load_dependent_friction" => drawn([1e-4, 0.5], |c| vec![("coefficient", c)]),
        "presliding_hysteresis" => {
            let (yields_rad, damping_s) = (between(rng, 0.01, 0.03), 0.01);
            drawn(efforts, move |f| {
                let stiffness = f / yields_rad;
                vec![
                    ("coulomb_nm", f),
                    ("bristle_stiffness_nm_per_rad", stiffness),
                    ("bristle_damping_nms_per_rad", stiffness * damping_s),
                ]
            })
        }
        "temperature_viscous" => {
            let (warm, time_s) = (
                0.3 + 0.5 * share,
                (plan.shortest_s() * between(rng, 0.4, 0.8)).max(FASTEST_WARM_UP_S),
            );
            drawn(efforts, move |f| {
                vec![
                    ("viscous_warm_nms_per_rad", warm * f / v),
                    ("viscous_extra_cold_nms_per_rad", f / v),
                    ("time_constant_s", time_s),
                ]
            })
        }
        "friction_step" => {
            let before = 0.2 + 0.3 * share;
            let change_s =
                plan.starts_s[site.recording] + plan.shortest_s() * between(rng, 0.3, 0.7);
            drawn(efforts, move |f| {
                vec![
                    ("coulomb_before_nm", f * before),
                    ("coulomb_after_nm", f),
                    ("change_time_session_s", change_s),
                ]
            })
        }
        _ => None,
    }
}

fn spring(name: &str, plan: &Plan, site: &Site, rng: &mut ChaCha8Rng) -> Option<Drawn> {
    let j = site.joint;
    let most = LARGEST_SHARE * plan.motor_nm[j];
    let efforts = [1e-4 * most, most];
    match name {
        "counterbalance_spring" => {
            let rest = between(rng, -PI, PI);
            drawn(efforts, move |f| {
                vec![("amplitude_nm", f), ("rest_angle_rad", rest)]
            })
        }
        "cable_spring" => {
            let joint = &plan.joints[j];
            let (reach, rest) = (joint.half(), joint.middle() + between(rng, -0.4, 0.4));
            drawn(efforts, move |f| {
                vec![
                    ("stiffness_nm_per_rad", f / reach),
                    ("rest_angle_rad", rest),
                ]
            })
        }
        "torque_ripple" => {
            let cycles = f64::from(rng.random_range(4..=24_u32));
            let phase = between(rng, -PI, PI);
            drawn(efforts, move |f| {
                vec![
                    ("amplitude_nm", f),
                    ("cycles_per_rev", cycles),
                    ("phase_rad", phase),
                ]
            })
        }
        "rotor_inertia" => {
            let a = plan.largest_acceleration[j];
            drawn(efforts, move |f| vec![("inertia_kgm2", f / a)])
        }
        "joint_elasticity" | "backlash" => {
            let q = plan.instants.first()?.target.position;
            let n = plan.joints.len();
            let moved = mass_matrix(&plan.model, &mut Data::new(&plan.model), &q[..n])[(j, j)];
            let rotor = moved * between(rng, 0.02, 0.1);
            if name == "backlash" {
                return drawn([5e-4, 0.03], move |gap| {
                    vec![("gap_rad", gap), ("rotor_inertia_kgm2", rotor)]
                });
            }
            // Not so soft that it sags by more than a twentieth of a radian.
            let softest = 20.0 * plan.largest_nm[j].max(0.1);
            drawn([1e-5, 1.0 / softest], move |give| {
                vec![
                    ("stiffness_nm_per_rad", 1.0 / give),
                    ("rotor_inertia_kgm2", rotor),
                ]
            })
        }
        _ => None,
    }
}

fn record(name: &str, plan: &Plan, site: &Site, rng: &mut ChaCha8Rng) -> Option<Drawn> {
    let j = site.joint;
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    match name {
        "torque_gain" => drawn([1e-4, 0.5], move |more| vec![("gain", 1.0 + sign * more)]),
        "torque_bias" => {
            let most = LARGEST_SHARE * plan.motor_nm[j];
            drawn([1e-4 * most, most], move |f| vec![("bias_nm", sign * f)])
        }
        "transmission_coupling" if site.source != j => {
            drawn([1e-4, 0.4], move |c| vec![("coefficient", sign * c)])
        }
        "torque_delay" => drawn([1e-3, 0.2], |delay| vec![("delay_s", delay)]),
        "torque_lowpass" => drawn([1e-3, 0.3], |time| vec![("cutoff_hz", 1.0 / (TAU * time))]),
        "torque_saturation" => {
            let largest = plan.largest_nm[j];
            drawn([0.05, 0.7], move |cut| {
                vec![("limit_nm", largest * (1.0 - cut))]
            })
        }
        _ => None,
    }
}
