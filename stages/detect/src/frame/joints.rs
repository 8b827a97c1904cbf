//! Whether what was learnt by joint belongs to the joints at hand.

use std::collections::BTreeSet;

/// A clause that says so if `found` and `joint_names` are not the same joints, in whatever order.
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

/// A clause that says so if `found` are not `joint_names` in their order.
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
