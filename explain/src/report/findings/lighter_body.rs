//! A body that is lighter than the twin's by no more than the bodies of a URDF are off: no tool is missing.

use serde_json::Value;
use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{ABSENT_TOOL, LEAST_ABSENT, share_of_carried};

use crate::report::schema::{Finding, SHARE_OF_CARRIED};

/// Says of a finding of an absent tool which share of the twin's body it is, and what a small share means.
pub(super) fn tell_share(finding: &mut Finding, model: &Model) {
    if finding.known_as() != ABSENT_TOOL.name {
        return;
    }
    let link = (finding.link.as_deref()).and_then(|link| model.link_index(link));
    let mass_kg = finding.parameters.get("mass_kg").and_then(Value::as_f64);
    let (Some(link), Some(mass_kg)) = (link, mass_kg) else {
        return;
    };
    let share = share_of_carried(model, link, mass_kg);
    finding
        .parameters
        .insert(SHARE_OF_CARRIED.to_owned(), Value::from(share));
    if share < LEAST_ABSENT {
        finding.sentence += &format!(
            " That is {:.0} % of what hangs there: the bodies of a URDF are off by as much, so no tool need be missing.",
            100.0 * share
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn a_twentieth_of_the_body_is_no_tool() {
        let model = fixture::model();
        let link = model.links()[model.tool_link()].name.clone();
        let whole = 1.0 / share_of_carried(&model, model.tool_link(), 1.0);
        for (share, is_off) in [(0.05, true), (0.9, false)] {
            let mut finding = fixture::finding("unknown");
            finding.link = Some(link.clone());
            finding.parameters = [
                ("kind".to_owned(), Value::from("absent_tool")),
                ("mass_kg".to_owned(), Value::from(share * whole)),
            ]
            .into();
            tell_share(&mut finding, &model);
            assert_eq!(finding.is_body_off(), is_off);
            assert_eq!(finding.sentence.contains("5 % of what hangs"), is_off);
        }
    }
}
