//! Names of a MuJoCo model's parts.

use std::collections::BTreeMap;

use mjcf_rs::{BodyId, Model};

/// Names of all bodies and joints. MuJoCo does not require a name; an unnamed part gets a generated one.
pub struct Names {
    pub bodies: Vec<String>,
    pub joints: BTreeMap<(BodyId, usize), String>,
}

impl Names {
    pub fn of(model: &Model) -> Self {
        let body = |(id, entry): (BodyId, &mjcf_rs::BodyEntry)| match (&entry.body.name, id) {
            (_, 0) => super::WORLD.to_owned(),
            (Some(name), _) => name.clone(),
            (None, id) => format!("body_{id}"),
        };
        let mut joints = BTreeMap::new();
        for (id, entry) in model.bodies_iter() {
            for (k, joint) in entry.body.joints.iter().enumerate() {
                let own = joint.name.clone();
                let name = own.unwrap_or_else(|| format!("joint_{}", joints.len()));
                joints.insert((id, k), name);
            }
        }
        Self {
            bodies: model.bodies.iter().enumerate().map(body).collect(),
            joints,
        }
    }
}
