//! Robots for the tests: random trees, written as URDF so that the reader takes part.

use std::fmt::Write;

use proptest::prelude::*;
use tauscope_dynamics::Model;

/// A link and the joint that moves it.
#[derive(Debug, Clone)]
pub struct Segment {
    /// The segment it hangs on, among those before it and the base.
    parent: prop::sample::Index,
    kind: &'static str,
    axis: [f64; 3],
    xyz: [f64; 3],
    rpy: [f64; 3],
    mass_kg: f64,
    com_m: [f64; 3],
    inertial_rpy: [f64; 3],
    /// Of a solid ellipsoid of the link's mass, so that the inertia is one.
    half_axes_m: [f64; 3],
    /// A second link, fixed to the first.
    flange: bool,
    /// The joint before it that it follows, with ratio and offset.
    mimics: Option<(prop::sample::Index, f64, f64)>,
}

fn vector(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

fn axis() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![
        Just([1.0, 0.0, 0.0]),
        Just([0.0, -1.0, 0.0]),
        Just([0.0, 0.0, 1.0]),
        Just([0.0, 0.0, -1.0]),
        vector(2.0).prop_filter("an axis has a direction", |v| v
            .iter()
            .any(|x| x.abs() > 0.1)),
    ]
}

fn segment() -> impl Strategy<Value = Segment> {
    let kind = prop_oneof![Just("revolute"), Just("continuous"), Just("prismatic")];
    let mimics = (any::<prop::sample::Index>(), -1.5..1.5_f64, -1.0..1.0_f64);
    (
        (
            any::<prop::sample::Index>(),
            kind,
            axis(),
            vector(0.5),
            vector(3.0),
        ),
        (
            0.5..5.0_f64,
            vector(0.3),
            vector(3.0),
            prop::array::uniform3(0.05..0.3_f64),
        ),
        any::<bool>(),
        prop::option::weighted(0.2, mimics),
    )
        .prop_map(|((parent, kind, axis, xyz, rpy), body, flange, mimics)| {
            let (mass_kg, com_m, inertial_rpy, half_axes_m) = body;
            Segment {
                parent,
                kind,
                axis,
                xyz,
                rpy,
                mass_kg,
                com_m,
                inertial_rpy,
                half_axes_m,
                flange,
                mimics,
            }
        })
}

/// A robot of one to seven joints, and whether its joints are written with the outermost first.
pub fn robot() -> impl Strategy<Value = String> {
    (prop::collection::vec(segment(), 1..8), any::<bool>())
        .prop_map(|(segments, reversed)| urdf(&segments, reversed))
}

/// A robot and three numbers per joint, each within ±2.
pub fn robot_in_motion() -> impl Strategy<Value = (Model, [Vec<f64>; 3])> {
    robot().prop_flat_map(|xml| {
        let model = Model::from_urdf(&xml).expect("the generated URDF is valid");
        let numbers = || prop::collection::vec(-2.0..2.0_f64, model.dof());
        let motion = [numbers(), numbers(), numbers()];
        (Just(model), motion)
    })
}

fn urdf(segments: &[Segment], reversed: bool) -> String {
    let mut parts = Vec::new();
    for (i, s) in segments.iter().enumerate() {
        let parent = match s.parent.index(i + 1) {
            0 => "base".to_owned(),
            k if segments[k - 1].flange => format!("flange{}", k - 1),
            k => format!("link{}", k - 1),
        };
        let mut part = String::new();
        let [a, b, c] = s.half_axes_m.map(|x| x * x * s.mass_kg / 5.0);
        let limit = if s.kind == "continuous" {
            ""
        } else {
            "<limit lower='-2' upper='2' velocity='1' effort='9'/>"
        };
        let mimic = match &s.mimics {
            Some((leader, ratio, offset)) if i > 0 => {
                let leader = leader.index(i);
                format!("<mimic joint='joint{leader}' multiplier='{ratio}' offset='{offset}'/>")
            }
            _ => String::new(),
        };
        write!(
            part,
            "<joint name='joint{i}' type='{}'><parent link='{parent}'/><child link='link{i}'/>
               <origin xyz='{}' rpy='{}'/><axis xyz='{}'/>{limit}{mimic}</joint>
             <link name='link{i}'><inertial><origin xyz='{}' rpy='{}'/><mass value='{}'/>
               <inertia ixx='{}' ixy='0' ixz='0' iyy='{}' iyz='0' izz='{}'/></inertial></link>",
            s.kind,
            words(s.xyz),
            words(s.rpy),
            words(s.axis),
            words(s.com_m),
            words(s.inertial_rpy),
            s.mass_kg,
            b + c,
            a + c,
            a + b,
        )
        .expect("a String takes all");
        if s.flange {
            write!(
                part,
                "<joint name='mount{i}' type='fixed'><parent link='link{i}'/><child link='flange{i}'/>
                   <origin xyz='{}' rpy='{}'/></joint>
                 <link name='flange{i}'><inertial><origin xyz='0.1 0 -0.2'/><mass value='0.7'/>
                   <inertia ixx='0.01' ixy='0' ixz='0' iyy='0.02' iyz='0.001' izz='0.015'/></inertial></link>",
                words(s.com_m),
                words(s.axis),
            )
            .expect("a String takes all");
        }
        parts.push(part);
    }
    if reversed {
        parts.reverse();
    }
    format!(
        "<robot name='random'><link name='base'/>{}</robot>",
        parts.concat()
    )
}

fn words([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}
