//! The URDF of a MuJoCo model for other readers.

use std::fmt::Write as _;

use tauscope_dynamics::MUJOCO;

use super::{TURNED_WORLD, WORLD};

/// Limit of effort, velocity and slide of a joint that has none. Interface: this project's reader takes `inf`, others do not.
const NO_LIMIT: &str = "1e9";
/// Mass and moments of inertia of a link between two joints of one body \[kg, kg m²\]. Interface: other readers ask for some.
const LEAST_MASS: &str = "1e-9";

/// A URDF of [`super::to_urdf`] without what only a MuJoCo model states.
pub fn without_mujoco(urdf: &str) -> String {
    let (mut text, mut slides) = (String::new(), false);
    // Each of these elements is a line of its own.
    for line in urdf.lines() {
        if line.trim_start().starts_with("<mujoco:") {
            continue;
        }
        if line.contains("<joint ") {
            slides = line.contains("type=\"prismatic\"");
        }
        let is_limit = line.trim_start().starts_with("<limit ");
        let between = line
            .strip_prefix("  <link name=\"")
            .filter(|rest| rest.ends_with("\"/>"));
        let is_world = [WORLD, TURNED_WORLD].map(|world| format!("{world}\"/>"));
        if let Some(name) = between.filter(|rest| is_world.iter().all(|world| world != rest)) {
            // MuJoCo refuses moving links without mass, and Gazebo drops them.
            let name = name.trim_end_matches("\"/>");
            let _ = writeln!(
                text,
                "  <link name=\"{name}\"><inertial><mass value=\"{LEAST_MASS}\"/><inertia ixx=\"{LEAST_MASS}\" ixy=\"0\" ixz=\"0\" \
                 iyy=\"{LEAST_MASS}\" iyz=\"0\" izz=\"{LEAST_MASS}\"/></inertial></link>"
            );
        } else if slides && is_limit && !line.contains("lower=") {
            // Without limits other readers lock a slide at zero.
            let head = line.trim_end_matches("/>");
            let _ = writeln!(text, "{head} lower=\"-{NO_LIMIT}\" upper=\"{NO_LIMIT}\"/>");
        } else {
            let _ = writeln!(text, "{line}");
        }
    }
    text.replace(&format!(" xmlns:mujoco=\"{MUJOCO}\""), "")
        .replace("=\"inf\"", &format!("=\"{NO_LIMIT}\""))
}
