//! A MuJoCo model (MJCF) as a URDF.
//!
//! `mjcf-rs` parses: includes, defaults and classes, angles in degrees. This file writes the tree of bodies as links and joints,
//! so that everything behind it knows one kind of robot. What a URDF lacks is put so that the motion is the same: a joint's
//! anchor and reference position are part of its origin, several joints of one body have links without mass in between, and
//! gravity in another direction turns the base.

mod bodies;
mod equalities;
mod includes;
mod names;
mod plain;
mod text;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use mjcf_rs::body::{Body, Joint, JointType};
use mjcf_rs::extras::ActuatorKind;
use mjcf_rs::{BodyId, Model, ParseError};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tauscope_dynamics::{Inertia, MUJOCO};

use bodies::{NoInertia, inertia, shapes};
use includes::folder_of;
pub use includes::whole;
use names::Names;
pub use plain::without_mujoco;
use text::{escaped, isometry, origin};

/// Gravity that every twin computes with \[m/s²\]. Physical: simulators use 9.81 instead of the standard 9.80665.
const GRAVITY_M_S2: f64 = 9.81;
/// Relative difference of gravity that is worth a sentence. Resolution: of an effort sensor's scale.
const GRAVITY_SHARE: f64 = 0.01;
/// Smallest turn of gravity that counts \[rad\]. Resolution: of seven digits in a file.
const LEAST_TURN_RAD: f64 = 1e-6;
/// Name of the root link: readers of URDF take a link of this name for their fixed world.
const WORLD: &str = "world";
/// Name of the link of MuJoCo's world frame, where its gravity is not along -z.
const TURNED_WORLD: &str = "turned_world";

/// Why a MuJoCo model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MjcfError {
    /// It is no MJCF, or one that its parser does not read.
    #[error("cannot read the MuJoCo model: {0}")]
    Parse(#[from] ParseError),
    /// A file of it is not XML.
    #[error("{0} is not well-formed XML: {1}")]
    Xml(String, String),
    /// An included file cannot be read.
    #[error("cannot read {}, which {within} includes: {reason}", .file.display())]
    Include {
        /// The file.
        file: PathBuf,
        /// The file that includes it.
        within: String,
        /// The reason.
        reason: String,
    },
    /// Nothing but a free body moves.
    #[error(
        "body `{0}` floats freely. Only robots with a fixed base can be explained: fix it by removing its <freejoint>, if it was held \
         while it was recorded"
    )]
    Floats(String),
    /// A joint that turns in all directions.
    #[error("joint `{0}` is a ball joint, which is not supported: its effort has three numbers")]
    Ball(String),
    /// The mass of a body is not in the file.
    #[error(
        "the MuJoCo model does not say {0}. Save what MuJoCo has computed, and use that file: {SAVE}"
    )]
    NoInertia(#[from] NoInertia),
    /// The compiler changes masses after the file has been read.
    #[error(
        "`<compiler {0}>` changes masses as MuJoCo loads the model. Save what MuJoCo has computed, and use that file: {SAVE}"
    )]
    Compiler(&'static str),
}

/// The command that saves a compiled model.
const SAVE: &str = "python3 -c \"import mujoco; s = mujoco.MjSpec.from_file('MODEL.xml'); s.compiler.saveinertial = True; s.compile(); \
                    s.to_file('SAVED.xml')\"";

/// The URDF of the model in `xml`, whose file is at `path`, and remarks on what a URDF cannot say.
///
/// # Errors
/// If it is no MuJoCo model of a robot with a fixed base, or a mass is not in the file.
pub fn to_urdf(xml: &str, path: &Path) -> Result<(String, Vec<String>), MjcfError> {
    let folder = folder_of(path);
    let model = Model::from_str(&whole(xml, path)?, folder)?;
    let compiler = &model.compiler;
    for (changes, name) in [
        (compiler.balance_inertia, "balanceinertia"),
        (compiler.bound_mass > 0.0, "boundmass"),
        (compiler.bound_inertia > 0.0, "boundinertia"),
        (compiler.set_total_mass > 0.0, "settotalmass"),
    ] {
        if changes {
            return Err(MjcfError::Compiler(name));
        }
    }
    let mut writer = Writer {
        model: &model,
        folder,
        names: Names::of(&model),
        text: String::new(),
        remarks: Vec::new(),
        anchors: BTreeMap::new(),
    };
    writer.robot()?;
    Ok((writer.text, writer.remarks))
}

struct Writer<'a> {
    model: &'a Model,
    folder: &'a Path,
    names: Names,
    text: String,
    remarks: Vec<String>,
    /// By body, its frame seen from its link: a link begins at the anchor of the joint that moves it.
    anchors: BTreeMap<BodyId, Isometry3<f64>>,
}

impl Writer<'_> {
    fn robot(&mut self) -> Result<(), MjcfError> {
        let name = self.model.name.as_deref().unwrap_or("robot");
        let name = escaped(name);
        let _ = writeln!(
            self.text,
            "<?xml version=\"1.0\"?>\n<robot name=\"{name}\" xmlns:mujoco=\"{MUJOCO}\">"
        );
        self.base();
        let mut floating = Vec::new();
        let mut left_out = vec![false; self.model.bodies.len()];
        for (id, entry) in self.model.bodies_iter() {
            let parent = entry.parent.unwrap_or(0);
            let is_free = |joint: &Joint| joint.type_ == JointType::Free;
            if entry.body.joints.iter().any(is_free) {
                floating.push(self.names.bodies[id].clone());
            }
            left_out[id] =
                left_out[parent] || entry.body.joints.iter().any(is_free) || entry.body.mocap;
            if !left_out[id] {
                self.body(id, parent, &entry.body)?;
            }
        }
        let moves = |id: BodyId| !left_out[id] && !self.model.bodies[id].body.joints.is_empty();
        match floating.first() {
            Some(first) if !(1..left_out.len()).any(moves) => {
                return Err(MjcfError::Floats(first.clone()));
            }
            Some(_) => self.remarks.push(format!(
                "{} float freely and are left out: {}",
                if floating.len() == 1 {
                    "a body"
                } else {
                    "bodies"
                },
                floating.join(", ")
            )),
            None => {}
        }
        self.couplings();
        self.text.push_str("</robot>\n");
        Ok(())
    }

    /// The world, below a link in whose frame gravity points down.
    fn base(&mut self) {
        let gravity = Vector3::from(self.model.option.gravity);
        let size = gravity.norm();
        if (size / GRAVITY_M_S2 - 1.0).abs() > GRAVITY_SHARE {
            self.remarks.push(format!(
                "the model's gravity is {size} m/s²; the twin computes with {GRAVITY_M_S2} m/s², because a real arm has weight"
            ));
        }
        // If gravity points up, any half turn about a level axis points it down.
        let half = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let turn = UnitQuaternion::rotation_between(&gravity, &-Vector3::z()).unwrap_or(half);
        if size == 0.0 || turn.angle() < LEAST_TURN_RAD {
            let _ = writeln!(self.text, "  <link name=\"{WORLD}\"/>");
            return;
        }
        let turned = Isometry3::from_parts(Translation3::identity(), turn);
        let _ = writeln!(
            self.text,
            "  <link name=\"{WORLD}\"/>\n  <link name=\"{TURNED_WORLD}\"/>\n  <joint name=\"gravity\" type=\"fixed\">\n    {}\n    \
             <parent link=\"{WORLD}\"/>\n    <child link=\"{TURNED_WORLD}\"/>\n  </joint>",
            origin(&turned)
        );
        TURNED_WORLD.clone_into(&mut self.names.bodies[0]);
    }

    fn body(&mut self, id: BodyId, parent: BodyId, body: &Body) -> Result<(), MjcfError> {
        let name = self.names.bodies[id].clone();
        let mut above = self.names.bodies[parent].clone();
        // The frame that the next joint begins in, seen from the link above.
        let anchor = self.anchors.get(&parent).copied();
        let mut at = anchor.unwrap_or_default() * isometry(&body.pose);
        if body.joints.is_empty() {
            let joint = format!("{name}_fixed");
            self.joint(&joint, "fixed", &at, (&above, &name), "");
            at = Isometry3::identity();
        }
        let last = body.joints.len().saturating_sub(1);
        for (k, joint) in body.joints.iter().enumerate() {
            let own = self.names.joints[&(id, k)].clone();
            if joint.type_ == JointType::Ball {
                return Err(MjcfError::Ball(own));
            }
            let below = if k == last {
                name.clone()
            } else {
                let between = format!("{name}_{k}");
                let _ = writeln!(self.text, "  <link name=\"{}\"/>", escaped(&between));
                between
            };
            let anchor = Translation3::from(Vector3::from(joint.pos));
            // At the reference position the body stands as it is drawn.
            let axis = Vector3::from(joint.axis).normalize();
            let back = match joint.type_ {
                JointType::Slide => Isometry3::translation(
                    -joint.ref_ * axis.x,
                    -joint.ref_ * axis.y,
                    -joint.ref_ * axis.z,
                ),
                _ => Isometry3::rotation(-joint.ref_ * axis),
            };
            let (kind, rest) = self.moving(joint, &own, axis);
            self.joint(&own, kind, &(at * anchor * back), (&above, &below), &rest);
            at = anchor.inverse() * Isometry3::identity();
            above = below;
        }
        self.anchors.insert(id, at);
        let mass = self.mass(id, body, &name)?;
        let visual = shapes(self.model, self.folder, body, &at);
        let from = at.translation;
        let _ = writeln!(
            self.text,
            "  <link name=\"{}\">\n    <mujoco:body pos=\"{} {} {}\"/>",
            escaped(&name),
            from.x,
            from.y,
            from.z
        );
        if let Some(mass) = mass {
            let [xx, xy, xz, yy, yz, zz] = mass.inertia_about_com_kgm2();
            let com = at * nalgebra::Point3::from(mass.com_m());
            let about = Isometry3::from_parts(com.coords.into(), at.rotation);
            let _ = writeln!(
                self.text,
                "    <inertial>\n      {}\n      <mass value=\"{}\"/>\n      <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" \
                 iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n    </inertial>",
                origin(&about),
                mass.mass_kg()
            );
        }
        self.text.push_str(&visual);
        self.text.push_str("  </link>\n");
        if body.gravcomp > 0.0 {
            self.remarks.push(format!(
                "body `{name}` has gravcomp=\"{}\", which a real arm has not: the twin computes its whole weight",
                body.gravcomp
            ));
        }
        Ok(())
    }

    /// The inertia of a body; `None` where it stands still: a mesh there needs no mass.
    fn mass(&self, id: BodyId, body: &Body, name: &str) -> Result<Option<Inertia>, NoInertia> {
        if !self.is_moved(id) {
            return Ok(None);
        }
        let own = inertia(self.model, body, name)?;
        // MuJoCo's condition: a body with joints, or one that is fixed to it, has a mass.
        if own.is_none() && !body.joints.is_empty() && !self.carries_mass(id)? {
            return Err(NoInertia::Massless(name.to_owned()));
        }
        Ok(own)
    }

    /// Whether a body that is fixed to this one has a mass.
    fn carries_mass(&self, id: BodyId) -> Result<bool, NoInertia> {
        for (child, entry) in self.model.bodies_iter() {
            if entry.parent == Some(id) && child != id && entry.body.joints.is_empty() {
                let own = inertia(self.model, &entry.body, &self.names.bodies[child])?;
                if own.is_some() || self.carries_mass(child)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }

    /// Whether a joint moves a body.
    fn is_moved(&self, id: BodyId) -> bool {
        let entry = &self.model.bodies[id];
        let parent = entry.parent.filter(|parent| *parent != id);
        !entry.body.joints.is_empty() || parent.is_some_and(|parent| self.is_moved(parent))
    }

    /// The URDF type of a joint, and its elements apart from origin, parent and child.
    fn moving(&self, joint: &Joint, name: &str, axis: Vector3<f64>) -> (&'static str, String) {
        let mut rest = format!("    <axis xyz=\"{} {} {}\"/>\n", axis.x, axis.y, axis.z);
        let autolimits = self.model.compiler.autolimits;
        let is_limited = joint.limited.resolve(autolimits, joint.range.is_some());
        let range = joint.range.filter(|_| is_limited);
        let effort = self.effort_limit(name);
        // The URDF reader asks for both, infinite where there is none.
        let mut limit = format!(
            "effort=\"{}\" velocity=\"inf\"",
            effort.unwrap_or(f64::INFINITY)
        );
        if let Some([lower, upper]) = range {
            let _ = write!(limit, " lower=\"{lower}\" upper=\"{upper}\"");
        }
        let _ = writeln!(rest, "    <limit {limit}/>");
        let _ = writeln!(
            rest,
            "    <mujoco:joint damping=\"{}\" frictionloss=\"{}\" armature=\"{}\" stiffness=\"{}\" springref=\"{}\"/>",
            joint.damping, joint.frictionloss, joint.armature, joint.stiffness, joint.springref
        );
        let kind = match (joint.type_, range) {
            (JointType::Slide, _) => "prismatic",
            (_, Some(_)) => "revolute",
            (_, None) => "continuous",
        };
        (kind, rest)
    }

    /// The largest effort of the actuators of a joint, if they say one.
    fn effort_limit(&self, joint: &str) -> Option<f64> {
        let drives = self.model.actuators.iter();
        let own = drives.filter(|actuator| actuator.joint.as_deref() == Some(joint));
        let most = |range: [f64; 2]| range[0].abs().max(range[1].abs());
        let of = |actuator: &mjcf_rs::extras::Actuator| {
            let is_motor = actuator.kind == ActuatorKind::Motor;
            let range = actuator.force_range;
            let range = range.or(actuator.ctrl_range.filter(|_| is_motor))?;
            Some(most(range) * actuator.gear[0].abs())
        };
        own.filter_map(of)
            .filter(|effort| *effort > 0.0)
            .reduce(f64::max)
    }

    fn joint(
        &mut self,
        name: &str,
        kind: &str,
        at: &Isometry3<f64>,
        (parent, child): (&str, &str),
        rest: &str,
    ) {
        let mimic = self.mimic(name);
        let _ = writeln!(
            self.text,
            "  <joint name=\"{}\" type=\"{kind}\">\n    {}\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n{rest}{mimic}  </joint>",
            escaped(name),
            origin(at),
            escaped(parent),
            escaped(child)
        );
    }
}
