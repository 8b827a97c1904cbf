//! Elements of simulators' files for each quantity.

use std::fmt::Write as _;

use tauscope_dynamics::terms::words::number;

use super::corrections::Corrections;

/// A simulator's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// URDF, as Isaac Sim, Gazebo, Pinocchio and others read it.
    Urdf,
    /// `MuJoCo`'s MJCF.
    Mjcf,
    /// `SDFormat`, as Gazebo reads it.
    Sdf,
    /// An actuator configuration of Isaac Lab.
    IsaacLab,
    /// URDF with Drake's elements.
    Drake,
}

/// All targets, in the order of the documentation.
pub const TARGETS: [Target; 5] = [
    Target::Urdf,
    Target::Mjcf,
    Target::Sdf,
    Target::IsaacLab,
    Target::Drake,
];

/// Element of a quantity in a simulator's file with its unit, or the reason why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The element.
    At(&'static str),
    /// No such element; the nearest alternative or the reason.
    None(&'static str),
}

use Place::{At, None as Lacks};

/// Names of quantities, as in the table.
const QUANTITIES: [&str; 8] = [
    "viscous friction",
    "dry friction",
    "dry friction at rest",
    "rotor inertia",
    "spring",
    "zero of a joint",
    "body",
    "direction of gravity",
];

impl Target {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Mjcf => "mjcf",
            Self::Sdf => "sdf",
            Self::IsaacLab => "isaaclab",
            Self::Drake => "drake",
        }
    }

    /// The target of that name.
    pub fn named(name: &str) -> Option<Self> {
        TARGETS.into_iter().find(|target| target.name() == name)
    }

    /// The outermost element of its file; `None` for a file that is created.
    pub fn root(self) -> Option<&'static str> {
        match self {
            Self::Urdf | Self::Drake => Some("robot"),
            Self::Mjcf => Some("mujoco"),
            Self::Sdf => Some("sdf"),
            Self::IsaacLab => None,
        }
    }

    /// The element of each quantity, with the quantity's name.
    pub fn places(self) -> [(&'static str, Place); 8] {
        let of_urdf =
            "not read by URDF's simulators; MuJoCo's armature or Drake's rotor_inertia is";
        let places = match self {
            Self::Urdf => [
                At("`<dynamics damping>` of the joint [N m s/rad or N s/m]"),
                At("`<dynamics friction>` of the joint [N m or N]"),
                Lacks("the friction in motion is written"),
                Lacks(of_urdf),
                Lacks("URDF has no springs"),
                At("`<origin>` of the joint, turned about its axis [rad or m]"),
                At("`<inertial>` of the link [kg, m, kg m²]"),
                Lacks("URDF has no gravity: turn the base where the robot is placed"),
            ],
            Self::Mjcf => [
                At("`damping` of the joint [N m s/rad or N s/m]"),
                At("`frictionloss` of the joint [N m or N]"),
                Lacks("MuJoCo has one dry friction; that in motion is written"),
                At("`armature` of the joint [kg m² or kg]"),
                At(
                    "`stiffness` [N m/rad or N/m] and `springref` of the joint [compiler's angle or m]",
                ),
                At("`ref` of the joint [compiler's angle or m]"),
                At("`<inertial>` of the body [kg, m, kg m²]"),
                At("`gravity` of `<option>` [m/s²]"),
            ],
            Self::Sdf => [
                At("`<damping>` in `<axis><dynamics>` [N m s/rad or N s/m]"),
                At("`<friction>` in `<axis><dynamics>` [N m or N]"),
                Lacks("the friction in motion is written"),
                Lacks(
                    "SDF has no rotor inertia; it may be added to the link's inertia about the axis where no other joint moves that link",
                ),
                At(
                    "`<spring_stiffness>` and `<spring_reference>` in `<axis><dynamics>` [N m/rad, rad; or N/m, m]",
                ),
                Lacks("turn the joint's `<pose>` about its axis by hand"),
                At("`<inertial>` of the link [kg, m, kg m²]"),
                Lacks("set `<gravity>` of the world by hand"),
            ],
            Self::IsaacLab => [
                At("`viscous_friction` of the actuator [N m s/rad or N s/m]"),
                At("`dynamic_friction` of the actuator [N m or N]"),
                At("`friction` of the actuator, that in motion if no other was found [N m or N]"),
                At("`armature` of the actuator [kg m² or kg]"),
                Lacks("an actuator has no spring but its controller's"),
                Lacks("correct the URDF that the asset is made from: --to urdf"),
                Lacks("correct the URDF that the asset is made from: --to urdf"),
                Lacks("set `gravity` of the simulation's configuration by hand"),
            ],
            Self::Drake => [
                At("`<dynamics damping>` of the joint [N m s/rad or N s/m]"),
                Lacks("Drake's parser ignores dry friction of joints; add it as an external force"),
                Lacks("Drake's parser ignores dry friction of joints"),
                At("`<drake:rotor_inertia>` of the actuator, with a gear ratio of 1 [kg m² or kg]"),
                Lacks("add a `RevoluteSpring` or `PrismaticSpring` in code"),
                At("`<origin>` of the joint, turned about its axis [rad or m]"),
                At("`<inertial>` of the link [kg, m, kg m²]"),
                Lacks("set the plant's gravity in code: `mutable_gravity_field()`"),
            ],
        };
        std::array::from_fn(|k| (QUANTITIES[k], places[k]))
    }

    /// One line for each written correction, and one for each that has no element.
    pub fn said(self, corrections: &Corrections) -> (Vec<String>, Vec<String>) {
        let (mut written, mut lost) = (Vec::new(), Vec::new());
        let places = self.places();
        let mut say = |quantity: usize, what: String| match places[quantity].1 {
            At(place) => written.push(format!("{what}: {}", place.replace('`', ""))),
            Lacks(why) => lost.push(format!("{what} is not written: {why}")),
        };
        for (joint, own) in &corrections.joints {
            let spring = own.spring.map(|[k, _]| k);
            let values = [
                own.damping,
                own.friction,
                own.static_friction,
                own.armature,
                spring,
                own.zero,
            ];
            for (k, value) in values.into_iter().enumerate() {
                if let Some(value) = value {
                    let value = number(value);
                    say(k, format!("{} of {joint}, {value}", QUANTITIES[k]));
                }
            }
        }
        for (link, body) in &corrections.bodies {
            let before = corrections
                .before
                .get(link)
                .map_or(0.0, tauscope_dynamics::Inertia::mass_kg);
            let mass = number(body.mass_kg());
            say(
                6,
                format!(
                    "mass of {link}, {mass} kg in place of {} kg",
                    number(before)
                ),
            );
        }
        if let Some([x, y, z]) = corrections.gravity {
            say(7, format!("gravity along ({x:.4}, {y:.4}, {z:.4}) m/s²"));
        }
        (written, lost)
    }

    /// Adds a comment before the first element that lists the written and the missing corrections.
    pub(super) fn with_comment(self, text: &str, written: &[String], lost: &[String]) -> String {
        let mut comment = String::from("Corrected by tauscope.\n");
        for (title, lines) in [("Written", written), ("Not written, or only nearly", lost)] {
            if !lines.is_empty() {
                let _ = writeln!(comment, "{title}:");
            }
            for line in lines {
                let _ = writeln!(comment, "  {line}");
            }
        }
        if self.root().is_none() {
            let lines = comment.lines().map(|line| format!("# {line}\n"));
            return lines.collect::<String>() + "\n" + text;
        }
        // A comment may not hold two hyphens.
        let comment = format!("<!--\n{}-->\n", comment.replace("--", "- -"));
        let declaration = text
            .find("?>")
            .filter(|_| text.trim_start().starts_with("<?xml"));
        let at = declaration.map_or(0, |end| {
            let rest = &text[end + 2..];
            end + 2 + (rest.len() - rest.trim_start().len())
        });
        format!("{}{comment}{}", &text[..at], &text[at..])
    }
}
