//! Tests of all terms, and helpers for tests of single terms.

use super::*;
use crate::{Data, rnea};

/// A robot of two joints whose second carries a tool, and a site in it.
pub(super) struct TwoJoints {
    pub model: Model,
}

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <joint name="one" type="continuous"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0.2"/></joint>
  <link name="upper"><inertial><origin xyz="0.01 0.02 0.2"/><mass value="3"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.02"/></inertial></link>
  <joint name="two" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/></joint>
  <link name="lower"><inertial><origin xyz="0.1 0 0.15"/><mass value="1.5"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="lower"/><child link="tool"/>
    <origin xyz="0 0 0.4" rpy="0.3 0.2 0.1"/></joint>
  <link name="tool"/></robot>"#;

impl TwoJoints {
    pub fn new() -> Self {
        Self {
            model: Model::from_urdf(ARM).unwrap(),
        }
    }

    /// The first joint, driven by the second, and the link that `place` needs.
    pub fn site_for(&self, place: PlaceKind) -> Site<'_> {
        let link = match place {
            PlaceKind::Tool => self.model.tool_link(),
            PlaceKind::Base => self.model.base_link(),
            _ => self.model.link_index("lower").unwrap(),
        };
        Site {
            model: &self.model,
            joint: 0,
            source: 1,
            link,
        }
    }

    pub fn site(&self) -> Site<'_> {
        self.site_for(PlaceKind::Joint)
    }
}

/// A motion sample that owns its values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instant {
    pub dt_s: f64,
    pub time_s: f64,
    pub position: [f64; 2],
    pub velocity: [f64; 2],
    pub acceleration: [f64; 2],
    pub transmitted: [f64; 2],
}

impl Instant {
    pub fn view(&self) -> MotionSample<'_> {
        MotionSample {
            dt_s: self.dt_s,
            recording_s: self.time_s,
            session_s: self.time_s + 100.0,
            position: &self.position,
            velocity: &self.velocity,
            acceleration: &self.acceleration,
            transmitted: &self.transmitted,
        }
    }
}

pub(super) fn sample(
    dt_s: f64,
    time_s: f64,
    position: [f64; 2],
    velocity: [f64; 2],
    acceleration: [f64; 2],
) -> Instant {
    Instant {
        dt_s,
        time_s,
        position,
        velocity,
        acceleration,
        transmitted: [0.0; 2],
    }
}

/// Asserts that two efforts are equal except for rounding.
pub(super) fn assert_near(found: [f64; 2], expected: [f64; 2]) {
    let is_near = |(a, b): (f64, f64)| (a - b).abs() < 1e-9;
    assert!(
        found.into_iter().zip(expected).all(is_near),
        "{found:?}, {expected:?}"
    );
}

/// Effort that a term adds at a single first instant.
pub(super) fn push(term: &mut dyn Term, q: [f64; 2], qd: [f64; 2], qdd: [f64; 2]) -> [f64; 2] {
    let mut effort = [0.0; 2];
    term.act(&sample(0.0, 0.0, q, qd, qdd).view(), &mut effort);
    effort
}

/// A motion at 100 Hz, with the rigid body's effort.
pub(super) fn motion(model: &Model, samples: u32) -> Vec<Instant> {
    motion_with(model, samples, 0.01)
}

/// [`motion`] with another step.
pub(super) fn motion_with(model: &Model, samples: u32, dt: f64) -> Vec<Instant> {
    let mut data = Data::new(model);
    let wave = |k: usize, order: i32, t: f64| {
        let (a, w, p) = [(0.8, 2.1, 0.3), (0.6, 3.3, 1.2)][k];
        let shift = f64::from(order) * std::f64::consts::FRAC_PI_2;
        a * f64::powi(w, order) * (w * t + p + shift).sin()
    };
    (0..samples)
        .map(|k| {
            let t = dt * f64::from(k);
            let of = |order| [wave(0, order, t), wave(1, order, t)];
            let dt_s = if k == 0 { 0.0 } else { dt };
            let mut at = sample(dt_s, t, of(0), of(1), of(2));
            let effort = rnea(
                model,
                &mut data,
                &at.position,
                &at.velocity,
                &at.acceleration,
            );
            at.transmitted.copy_from_slice(effort);
            at
        })
        .collect()
}

/// Effort that a term adds along a motion.
pub(super) fn run(term: &mut dyn Term, motion: &[Instant]) -> Vec<[f64; 2]> {
    term.reset();
    motion
        .iter()
        .map(|at| {
            let mut effort = at.transmitted;
            term.act(&at.view(), &mut effort);
            [0, 1].map(|j| effort[j] - at.transmitted[j])
        })
        .collect()
}

/// Plausible coordinates for a term of this effect: factors near 1, shapes within their range, and times within the
/// motion.
pub(super) fn plausible(effect: &Effect) -> Vec<f64> {
    let one = |(i, coordinate): (usize, &Coordinate)| match coordinate.kind {
        CoordinateKind::Factor { .. } => 0.7 + 0.13 * i as f64,
        CoordinateKind::Shape {
            lower,
            upper,
            scale: Scale::Log,
            ..
        } => lower.powf(0.6) * upper.powf(0.4),
        CoordinateKind::Shape {
            lower,
            upper,
            scale: Scale::Linear,
            ..
        } => 0.8 * lower + 0.2 * upper,
        // Relative to an effort of about 20 N m.
        CoordinateKind::Shape { lower, .. } => 10.0 * lower,
        CoordinateKind::RecordingTime => 0.5 + 0.05 * i as f64,
        CoordinateKind::SessionTime => 100.5 + 0.05 * i as f64,
    };
    effect.coordinates.iter().enumerate().map(one).collect()
}

fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
}

fn factors(effect: &Effect) -> Vec<usize> {
    let is_factor = |c: &Coordinate| matches!(c.kind, CoordinateKind::Factor { .. });
    (0..effect.coordinates.len())
        .filter(|&i| is_factor(&effect.coordinates[i]))
        .collect()
}

#[test]
fn names_are_unique_and_found() {
    for one in EFFECTS {
        assert!(std::ptr::eq(effect(one.name).unwrap(), *one));
    }
    assert!(effect("viscous friction").is_none());
}

#[test]
fn coordinates_and_parameters_say_the_same() {
    for effect in EFFECTS {
        let coordinates = plausible(effect);
        let parameters = (effect.to_parameters)(&coordinates);
        assert_eq!(parameters.len(), effect.parameters.len(), "{}", effect.name);
        for (parameter, value) in effect.parameters.iter().zip(&parameters) {
            assert!(
                effect.check(parameter.name, *value).is_ok(),
                "{}",
                effect.name
            );
        }
        let again = (effect.to_coordinates)(&parameters);
        for (a, b) in coordinates.iter().zip(&again) {
            assert!(
                (a - b).abs() < 1e-9,
                "{}: {coordinates:?} {again:?}",
                effect.name
            );
        }
        // Without any effect, direction and phase are arbitrary but must be numbers.
        let nothing = (effect.to_parameters)(&vec![0.0; coordinates.len()]);
        assert!(nothing.iter().all(|x| x.is_finite()), "{}", effect.name);
    }
}

#[test]
fn a_term_survives_its_file() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 100);
    for effect in EFFECTS.iter().filter(|e| !e.coordinates.is_empty()) {
        let site = robot.site_for(effect.place);
        let mut term = (effect.build)(&site, &plausible(effect));
        let spec = TermSpec::of(&*term, &site);
        let text = serde_json::to_string(&spec).unwrap();
        let again: TermSpec = serde_json::from_str(&text).unwrap();
        assert_eq!((&again.joint, &again.link), (&spec.joint, &spec.link));
        let mut again = again.build(&robot.model).unwrap();
        let difference = difference(&run(&mut *term, &motion), &run(&mut *again, &motion));
        assert!(difference < 1e-6, "{}: {difference}", effect.name);
    }
}

/// The motion, preceded by a standstill at its beginning.
fn after_a_standstill(mut motion: Vec<Instant>) -> Vec<Instant> {
    let at = |k: u32| Instant {
        dt_s: if k == 0 { 0.0 } else { 0.01 },
        time_s: 0.01 * f64::from(k) - 0.2,
        velocity: [0.0; 2],
        acceleration: [0.0; 2],
        ..motion[0]
    };
    let still: Vec<Instant> = (0..20).map(at).collect();
    motion[0].dt_s = 0.01;
    [still, motion].concat()
}

#[test]
fn factors_are_factors_and_without_them_nothing_happens() {
    let robot = TwoJoints::new();
    let motion = after_a_standstill(motion(&robot.model, 150));
    for effect in EFFECTS {
        let site = robot.site_for(effect.place);
        let at = |coordinates: &[f64]| run(&mut *(effect.build)(&site, coordinates), &motion);
        let mut none = plausible(effect);
        for i in factors(effect) {
            none[i] = 0.0;
        }
        let without = at(&none);
        if !factors(effect).is_empty() && !effect.splits_joint() {
            assert!(
                difference(&without, &vec![[0.0; 2]; motion.len()]) == 0.0,
                "{}",
                effect.name
            );
        }
        for i in factors(effect) {
            let CoordinateKind::Factor { step, .. } = effect.coordinates[i].kind else {
                continue;
            };
            let mut with = none.clone();
            with[i] = step;
            let one = at(&with);
            with[i] = 2.0 * step;
            let two = at(&with);
            let mut scale = 0.0_f64;
            let mut worst = 0.0_f64;
            for ((zero, one), two) in without.iter().zip(&one).zip(&two) {
                for j in 0..2 {
                    let effect = one[j] - zero[j];
                    scale = scale.max(effect.abs());
                    worst = worst.max((two[j] - zero[j] - 2.0 * effect).abs());
                }
            }
            let tolerance = if step < 1.0 { 1e-2 } else { 1e-9 };
            assert!(scale > 0.0, "{}: {i} does nothing", effect.name);
            assert!(
                worst <= tolerance * scale,
                "{}: {i}: {worst} of {scale}",
                effect.name
            );
        }
    }
}

#[test]
fn a_reset_forgets() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 200);
    for effect in EFFECTS {
        let mut term = (effect.build)(&robot.site_for(effect.place), &plausible(effect));
        let first = run(&mut *term, &motion[50..]);
        run(&mut *term, &motion[..70]);
        assert_eq!(run(&mut *term, &motion[50..]), first, "{}", effect.name);
    }
}

#[test]
fn friction_only_takes() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 300);
    let friction = EFFECTS.iter().filter(|effect| {
        let family = matches!(effect.family, Family::PlainFriction | Family::Friction);
        // Presliding friction is elastic and returns part of its energy.
        family && effect.name != "presliding_hysteresis"
    });
    for effect in friction {
        let name = effect.name;
        let mut term = (effect.build)(&robot.site(), &plausible(effect));
        for (at, effort) in motion.iter().zip(run(&mut *term, &motion)) {
            assert!(effort[0] * at.velocity[0] >= 0.0, "{name}");
            assert_eq!(effort[1], 0.0, "{name}");
        }
    }
}

#[test]
fn what_alters_the_model_costs_the_same_either_way() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 50);
    for effect in EFFECTS {
        let site = robot.site_for(effect.place);
        let mut term = (effect.build)(&site, &plausible(effect));
        let mut altered = robot.model.clone();
        if !term.alter(&mut altered) {
            assert!(term.inertia().is_none(), "{}", effect.name);
            continue;
        }
        let mut data = Data::new(&altered);
        for (at, added) in motion.iter().zip(run(&mut *term, &motion)) {
            let effort = rnea(
                &altered,
                &mut data,
                &at.position,
                &at.velocity,
                &at.acceleration,
            );
            for j in 0..2 {
                let expected = effort[j] - at.transmitted[j];
                assert!((added[j] - expected).abs() < 1e-9, "{}", effect.name);
            }
        }
        let Some((link, inertia)) = term.inertia() else {
            continue;
        };
        let mut attached = robot.model.clone();
        attached.attach(link, inertia);
        for joint in 0..2 {
            let (a, b) = (
                altered.body_parameters(joint),
                attached.body_parameters(joint),
            );
            assert!(
                a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12),
                "{}",
                effect.name
            );
        }
    }
}

#[test]
fn a_body_costs_what_its_inertia_of_the_instant_costs() {
    let robot = TwoJoints::new();
    let motion = motion(&robot.model, 50);
    let mut bodies = 0;
    for effect in EFFECTS {
        let site = robot.site_for(effect.place);
        let mut term = (effect.build)(&site, &plausible(effect));
        let added = run(&mut *term, &motion);
        let is_body = motion
            .iter()
            .any(|at| term.inertia_at(&at.view()).is_some());
        bodies += usize::from(is_body);
        for (at, added) in motion.iter().zip(added).filter(|_| is_body) {
            let mut expected = [0.0; 2];
            if let Some((link, inertia)) = term.inertia_at(&at.view()) {
                let ghost = robot.model.ghost(link, inertia);
                let mut data = Data::new(&ghost);
                let (q, qd, qdd) = (&at.position, &at.velocity, &at.acceleration);
                expected.copy_from_slice(rnea(&ghost, &mut data, q, qd, qdd));
            }
            for j in 0..2 {
                assert!((added[j] - expected[j]).abs() < 1e-9, "{}", effect.name);
            }
        }
    }
    assert!(bodies >= 5, "{bodies}");
}

#[test]
fn a_sign_is_full_at_a_few_hundredths_and_smooth_through_zero() {
    assert!((sign(0.02) - 1.0).abs() < 1e-7);
    assert!((sign(-0.02) + 1.0).abs() < 1e-7);
    assert_eq!(sign(0.0), 0.0);
    assert!((sign(0.002) - 1.0_f64.tanh()).abs() < 1e-15);
}
