//! Units of parameters, from their canonical names.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{PlaceKind, words};

use crate::physics::active::Hypothesis;

impl Hypothesis {
    /// Whether it is an effect of a joint that slides, so that its numbers are in N and m.
    pub fn slides(&self, model: &Model) -> bool {
        self.effect.place == PlaceKind::Joint && model.joints()[self.place.joint].slides()
    }
}

/// Unit of a parameter, from its canonical name; empty for a pure number.
pub fn unit(parameter: &str) -> &'static str {
    words::unit(parameter).map_or("", |(_, unit)| unit)
}

/// The power of an effort that a parameter is proportional to: 1 for an effort, or an effort per something, -1 for something
/// per effort.
pub fn power_of_effort(parameter: &str) -> i32 {
    match unit(parameter) {
        "1/(N m)" => -1,
        unit if unit.starts_with("N m") || unit == "kg m²" => 1,
        _ => 0,
    }
}

/// Whether a parameter of a body or a force is proportional to the effort that it is estimated from.
pub fn grows_with_effort(parameter: &str) -> bool {
    let whole = ["mass_kg", "stiffness_n_per_m"].contains(&parameter);
    whole || parameter.starts_with("force_") || parameter.starts_with("delta_")
}
