//! Tool link, base link and names of bodies, and a placeholder model for an unknown robot.

use nalgebra::{Matrix3, Vector3};

use super::{Body, Drive, Frame, GRAVITY_M_S2, Joint, JointKind, Limits, Link, Load, Model};
use crate::inertia::Inertia;

/// Share of a rigid body's mass below which a link is a dummy.
/// Derived: masses in a URDF are accurate to about a tenth, so that a hundredth of the mass changes nothing that can be
/// measured.
pub(super) const LEAST_SHARE: f64 = 0.01;

impl Model {
    /// Link that holds tools and payloads: the one named `tool` or, failing that, `tool0`. Otherwise, among the links
    /// without children, the one with the most movable joints between it and the base, the last of several.
    pub fn tool_link(&self) -> usize {
        let moves = |link: &usize| self.links[*link].joint.is_some();
        let mut named = ["tool", "tool0"]
            .iter()
            .filter_map(|name| self.link_index(name));
        if let Some(link) = named.find(moves) {
            return link;
        }
        let holds = |link: usize| self.links.iter().any(|other| other.parent == Some(link));
        (0..self.links.len())
            .filter(|&link| !holds(link))
            .max_by_key(|&link| self.joints_before(link))
            .unwrap_or(0)
    }

    /// Fixed link that carries all others.
    pub fn base_link(&self) -> usize {
        let root = self.links.iter().position(|link| link.parent.is_none());
        root.unwrap_or(0)
    }

    /// The link that the body of `joint` is named after: the joint's child link, or where that is a dummy, the heaviest
    /// of the links that move with it as one rigid body.
    ///
    /// Converters from MJCF and some makers' URDFs put a dummy link between a joint and the link that it moves. A child
    /// link is a dummy if it has less than a hundredth of the mass of its rigid body.
    ///
    /// # Panics
    /// If `joint` is not an index into [`Model::joints`].
    pub fn body_link(&self, joint: usize) -> usize {
        let child = self.joints[joint].child_link;
        let slot = self.frames[child].slot;
        let group = || (0..self.links.len()).filter(move |&link| self.frames[link].slot == slot);
        let mass = |link: usize| self.links[link].mass_kg();
        let total: f64 = group().map(mass).sum();
        if mass(child) >= LEAST_SHARE * total {
            return child;
        }
        let heaviest = group().max_by(|&a, &b| mass(a).total_cmp(&mass(b)));
        heaviest.unwrap_or(child)
    }

    /// Name of the link that the body of `joint` is named after, see [`Model::body_link`].
    ///
    /// # Panics
    /// If `joint` is not an index into [`Model::joints`].
    pub fn body_name(&self, joint: usize) -> &str {
        &self.links[self.body_link(joint)].name
    }

    /// Number of movable joints between a link and the base.
    fn joints_before(&self, link: usize) -> usize {
        let mut count = 0;
        let mut at = self.links[link].joint;
        while let Some(joint) = at {
            count += 1;
            at = self.links[self.joints[joint].parent_link].joint;
        }
        count
    }

    /// Creates a chain of joints with these names without masses or lengths: a placeholder for a robot of which only
    /// the joint names are known. Its motion requires no effort.
    pub fn massless(joint_names: &[String]) -> Self {
        let link = |name: String, parent: Option<usize>| Link {
            name,
            inertia: Inertia::zero(),
            shapes: Vec::new(),
            parent,
            joint: parent,
        };
        let frame = |slot| Frame {
            slot,
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
        };
        let mut model = Self {
            name: String::new(),
            joints: Vec::new(),
            followers: Vec::new(),
            links: vec![link("base".to_owned(), None)],
            bodies: Vec::new(),
            frames: vec![frame(0)],
            gravity: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
            tool_on: None,
        };
        for (j, name) in joint_names.iter().enumerate() {
            model.joints.push(Joint {
                name: name.clone(),
                kind: JointKind::Continuous,
                parent_link: j,
                child_link: j + 1,
                axis: [0.0, 0.0, 1.0],
                limits: Limits::default(),
                drive: Drive::default(),
            });
            // Behind link j, moved by joint j.
            model.links.push(link(format!("{name}_link"), Some(j)));
            model.frames.push(frame(j + 1));
            model.bodies.push(Body {
                joint: j,
                ratio: 1.0,
                offset: 0.0,
                block: j,
                parent: j,
                prismatic: false,
                rotation: Matrix3::identity(),
                translation: Vector3::zeros(),
                alignment: Matrix3::identity(),
                own: Inertia::zero(),
                tool: Inertia::zero(),
                load: Load::default(),
            });
        }
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Data, rnea};

    /// A joint with a dummy as its child, and a real link fixed to that.
    fn with_dummy(dummy_kg: f64) -> Model {
        let inertial = |kg: f64| {
            format!(
                "<inertial><mass value='{kg}'/><inertia ixx='0.01' ixy='0' ixz='0' iyy='0.01' iyz='0' izz='0.01'/>\
                 </inertial>"
            )
        };
        Model::from_urdf(&format!(
            "<robot name='r'><link name='base'>{}</link><link name='dummy'>{}</link><link name='arm'>{}</link>\
             <link name='cover'>{}</link>\
             <joint name='j' type='continuous'><parent link='base'/><child link='dummy'/></joint>\
             <joint name='w' type='fixed'><parent link='dummy'/><child link='arm'/></joint>\
             <joint name='v' type='fixed'><parent link='dummy'/><child link='cover'/></joint></robot>",
            inertial(9.0),
            inertial(dummy_kg),
            inertial(2.0),
            inertial(0.5),
        ))
        .unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn a_body_is_named_after_the_link_that_carries_the_mass() {
        for (dummy_kg, name) in [(0.0, "arm"), (0.001, "arm"), (0.1, "dummy"), (3.0, "dummy")] {
            let model = with_dummy(dummy_kg);
            assert_eq!(model.body_name(0), name, "{dummy_kg} kg");
            assert_eq!(model.links()[model.body_link(0)].name, name);
        }
        let massless = Model::massless(&["a".to_owned()]);
        assert_eq!(massless.body_name(0), "a_link");
    }

    #[test]
    fn a_massless_chain_costs_nothing() {
        let names = ["a".to_owned(), "b".to_owned(), "c".to_owned()];
        let model = Model::massless(&names);
        let mut data = Data::new(&model);
        let effort = rnea(&model, &mut data, &[0.1; 3], &[1.0; 3], &[2.0; 3]);
        assert_eq!(effort, [0.0; 3]);
        assert_eq!(model.joint_names().collect::<Vec<_>>(), ["a", "b", "c"]);
        assert_eq!(model.links()[model.tool_link()].name, "c_link");
        assert_eq!(model.base_link(), 0);
    }
}
