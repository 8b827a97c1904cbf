//! Equality constraints and tendons of a MuJoCo model: what a URDF can say of them, and a remark on the rest.

use mjcf_rs::equality::{Equality, EqualityJoint};

use super::Writer;
use super::text::escaped;

impl Writer<'_> {
    /// The `<mimic>` of a joint that an equality constraint ties to another by a straight line.
    pub fn mimic(&self, name: &str) -> String {
        let ties = self.model.equality.iter();
        let own = ties.filter_map(|tie| match tie {
            Equality::Joint(tie) if tie.common.active && tie.joint1 == name => Some(tie),
            _ => None,
        });
        let reference = |name: &str| {
            let joint = self.model.joint_by_name(name);
            joint.map_or(0.0, |(body, k)| self.model.bodies[body].body.joints[k].ref_)
        };
        let of = |tie: &EqualityJoint| {
            let other = tie.joint2.as_deref()?;
            let [offset, ratio, rest @ ..] = tie.polycoef;
            // Both positions of the constraint count from their references.
            let offset = offset + reference(name) - ratio * reference(other);
            rest.iter().all(|c| *c == 0.0).then(|| {
                format!(
                    "    <mimic joint=\"{}\" multiplier=\"{ratio}\" offset=\"{offset}\"/>\n",
                    escaped(other)
                )
            })
        };
        own.into_iter().find_map(of).unwrap_or_default()
    }

    /// Says which constraints the tree of bodies does not have.
    pub fn couplings(&mut self) {
        let is_loop = |tie: &&Equality| match tie {
            Equality::Connect(tie) => tie.common.active,
            Equality::Weld(tie) => tie.common.active,
            Equality::Joint(tie) => {
                tie.common.active
                    && tie.joint2.is_some()
                    && tie.polycoef[2..].iter().any(|c| *c != 0.0)
            }
            Equality::Tendon(tie) => tie.common.active,
        };
        let loops = self.model.equality.iter().filter(is_loop).count();
        if loops > 0 {
            self.remarks.push(format!(
                "{loops} equality constraints (closed loops, tendons, curves) are not part of the twin, which is a tree of bodies"
            ));
        }
        if !self.model.tendons.is_empty() {
            let count = self.model.tendons.len();
            self.remarks
                .push(format!("{count} tendons are not part of the twin"));
        }
    }
}
