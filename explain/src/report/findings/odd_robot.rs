//! Implausible bodies of a URDF: evidence in the URDF itself that they were not measured.

use nalgebra::Matrix3;
use tauscope_dynamics::terms::words::number;
use tauscope_dynamics::terms::{Effect, Family};
use tauscope_dynamics::{Link, Model};

/// Smallest number of links with the same mass that is not a coincidence.
/// Statistical: masses of links are given with three digits.
const LEAST_ALIKE: usize = 3;
/// Relative difference below which two masses are equal.
/// Resolution: that of a decimal number in a URDF.
const ALIKE: f64 = 1e-6;
/// Smallest contribution of the distance between frame and centre to an inertia, relative to its trace: near the
/// frame, the reference point cannot be determined.
/// Physical: a rod about its end has 0.75 there, the housing of a joint about its axis 0.1 and less.
const LEAST_SHARE: f64 = 0.3;

/// Returns the implausible properties of a robot's bodies as sentences.
pub fn oddities(model: &Model) -> Vec<String> {
    let moving = model.links().iter();
    let moving: Vec<&Link> = moving
        .filter(|link| link.joint.is_some() && link.mass_kg() > 0.0)
        .collect();
    let mut odd = Vec::new();
    if let Some(first) = moving.first()
        && moving.len() >= LEAST_ALIKE
        && (moving.iter()).all(|link| (link.mass_kg() / first.mass_kg() - 1.0).abs() < ALIKE)
    {
        odd.push(format!(
            "In the URDF all {} moving links have the same mass, {} kg, so these are probably placeholders. A finding that acts like a \
             weight (a body, a spring or a gain) may be their error. Enter the manufacturer's masses, then explain again.",
            moving.len(),
            number(first.mass_kg())
        ));
    }
    let about_frame: Vec<&str> = (moving.iter())
        .filter(|link| is_about_frame(link))
        .map(|link| link.name.as_str())
        .collect();
    if about_frame.len() >= LEAST_ALIKE && 2 * about_frame.len() > moving.len() {
        odd.push(format!(
            "In the URDF the inertias of {} are given about the link's frame instead of the centre of mass. \
             A finding that acts like a body may be this error. Correct the inertias, then explain again.",
            about_frame.join(", ")
        ));
    }
    odd
}

/// Whether errors of such bodies imitate an effect: one that acts like a weight or is proportional to one.
pub fn imitates(effect: &Effect) -> bool {
    let of_family = matches!(effect.family, Family::Body | Family::Spring);
    (of_family && !effect.traits.describes_only) || effect.traits.is_scale
}

/// Whether the inertia declared about the centre of mass is one about the link's frame: after subtraction of the
/// contribution of the distance (Steiner), it is still that of a body. For an inertia about the centre, too little
/// would remain.
fn is_about_frame(link: &Link) -> bool {
    let [x, y, z] = link.com_m();
    let [xx, xy, xz, yy, yz, zz] = link.inertia.inertia_about_com_kgm2();
    let given = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let centre = nalgebra::Vector3::new(x, y, z);
    let distance = centre.norm_squared() * Matrix3::identity() - centre * centre.transpose();
    let added = link.mass_kg() * distance;
    if added.trace() < LEAST_SHARE * given.trace() {
        return false;
    }
    let own = given - added;
    let principal = own.symmetric_eigenvalues();
    principal.min() > 0.0 && 2.0 * principal.max() <= principal.sum() * (1.0 + ALIKE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Builds four links in a row, rods of these masses; the inertia of each is about its middle, or about its frame
    /// at one end.
    fn robot(masses_kg: [f64; 4], about_frame: bool) -> Model {
        let mut urdf = String::from("<robot name=\"rods\"><link name=\"link0\"/>");
        for (k, mass) in masses_kg.iter().enumerate() {
            let (own, thin) = (mass * 0.16 / 12.0, mass * 4e-4);
            let across = own + thin + if about_frame { mass * 0.04 } else { 0.0 };
            urdf += &format!(
                "<link name=\"link{0}\"><inertial><origin xyz=\"0.2 0 0\"/><mass value=\"{mass}\"/>\
                 <inertia ixx=\"{thin}\" iyy=\"{across}\" izz=\"{across}\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
                 <joint name=\"joint{0}\" type=\"continuous\"><parent link=\"link{k}\"/><child link=\"link{0}\"/>\
                 <origin xyz=\"0.4 0 0\"/><axis xyz=\"0 1 0\"/></joint>",
                k + 1
            );
        }
        Model::from_urdf(&(urdf + "</robot>")).unwrap()
    }

    #[test]
    fn placeholders_and_inertias_about_frames_are_seen_and_a_sound_robot_is_not_odd() {
        let different = [4.0, 3.0, 2.0, 1.0];
        assert!(oddities(&robot(different, false)).is_empty());
        let same = oddities(&robot([1.0; 4], false));
        assert!(
            same.len() == 1 && same[0].contains("all 4 moving links"),
            "{same:?}"
        );
        let about = oddities(&robot(different, true));
        assert!(
            about.len() == 1 && about[0].contains("link1, link2"),
            "{about:?}"
        );
    }

    #[test]
    fn weights_and_springs_are_doubted_and_friction_is_not() {
        let is = |name: &str| imitates(tauscope_dynamics::terms::effect(name).unwrap());
        for name in [
            "payload",
            "link_com",
            "counterbalance_spring",
            "torque_gain",
        ] {
            assert!(is(name), "{name}");
        }
        assert!(!is("coulomb_friction") && !is("unknown"));
    }
}
