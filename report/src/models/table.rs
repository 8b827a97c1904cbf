//! The tables of `docs/simulators.md`.

use std::fmt::Write as _;

use tauscope_dynamics::terms::{EFFECTS, Exported, Quantity, effect};

use super::target::{Place, TARGETS};

/// The elements of each simulator for each quantity, and the quantities of each effect, as Markdown.
pub fn table() -> String {
    let mut text = String::from("| | ");
    let names = TARGETS.map(|target| format!("`{}`", target.name()));
    let _ = writeln!(text, "{} |", names.join(" | "));
    let _ = writeln!(text, "|{}", " --- |".repeat(TARGETS.len() + 1));
    let places = TARGETS.map(super::Target::places);
    for (k, (quantity, _)) in places[0].iter().enumerate() {
        let cells = places.iter().map(|places| match places[k].1 {
            Place::At(element) => element.to_owned(),
            Place::None(why) => format!("none: {why}"),
        });
        let cells: Vec<String> = cells.collect();
        let _ = writeln!(text, "| {quantity} | {} |", cells.join(" | "));
    }
    text.push_str("\n| effect | in a simulator's model |\n| --- | --- |\n");
    for of in EFFECTS {
        let said = match of.exported {
            Exported::As(quantities) => named(&quantities(&ones(of.name))),
            Exported::Nearest(quantities, lost) => {
                format!("{}: {lost}", named(&quantities(&ones(of.name))))
            }
            Exported::No(why) => format!("none: {why}"),
        };
        let _ = writeln!(text, "| `{}` | {said} |", of.name);
    }
    text
}

/// A value for each parameter of an effect.
fn ones(name: &str) -> Vec<f64> {
    let count = effect(name).map_or(0, |effect| effect.parameters.len());
    vec![1.0; count]
}

fn named(quantities: &[Quantity]) -> String {
    let name = |quantity: &Quantity| match quantity {
        Quantity::Damping(_) => "viscous friction",
        Quantity::DryFriction(_) => "dry friction",
        Quantity::StaticFriction(_) => "dry friction at rest",
        Quantity::Armature(_) => "rotor inertia",
        Quantity::Spring { .. } => "spring",
        Quantity::Zero(_) => "zero of a joint",
        Quantity::Body => "body",
        Quantity::Gravity => "direction of gravity",
    };
    quantities.iter().map(name).collect::<Vec<_>>().join(", ")
}
