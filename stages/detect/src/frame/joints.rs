//! Checks that data learnt by joint belongs to the cell's joints.

use std::collections::BTreeSet;

/// Returns a clause that describes the mismatch if `found` and `joint_names` differ, regardless of their order.
pub(crate) fn others<'a>(
    found: impl Iterator<Item = &'a String>,
    joint_names: &[String],
) -> Option<String> {
    let found: Vec<&String> = found.collect();
    let set: BTreeSet<&String> = joint_names.iter().collect();
    let same =
        found.len() == joint_names.len() && found.iter().copied().collect::<BTreeSet<_>>() == set;
    (!same).then(|| of(&found, joint_names))
}

/// Returns a clause that describes the mismatch if `found` and `joint_names` differ, including their order.
pub(crate) fn in_other_order<'a>(
    found: impl Iterator<Item = &'a String>,
    joint_names: &[String],
) -> Option<String> {
    let found: Vec<&String> = found.collect();
    let same = found.iter().copied().eq(joint_names);
    (!same).then(|| of(&found, joint_names))
}

fn of(found: &[&String], joint_names: &[String]) -> String {
    let found: Vec<&str> = found.iter().map(|name| name.as_str()).collect();
    let (found, cell) = (found.join(", "), joint_names.join(", "));
    format!("is of the joints {found}, but the cell has {cell}")
}
