//! Differences between the joint names of the messages and those of the URDF.

use tauscope_session::suggest::LEAST_SIMILARITY;

/// Maximum number of pairs named in a sentence.
const MAX_PAIRS: usize = 4;

/// Describes the likeliest mistake if `found` lacks joints of `wanted`.
pub(super) fn slip(wanted: &[String], found: &[String]) -> Option<String> {
    let missing: Vec<&String> = wanted.iter().filter(|name| !found.contains(name)).collect();
    if missing.is_empty() || found.is_empty() {
        return None;
    }
    if let Some(affix) = common_affix(wanted, found) {
        return Some(format!(
            "{affix}: give the URDF's joints the same names (xacro: `prefix` or `tf_prefix`)"
        ));
    }
    let pairs = pairs(&missing, wanted, found);
    if pairs.is_empty() {
        return Some(if missing.len() == wanted.len() {
            "these joints are those of another robot: check `robot` of the cell, and the topic"
                .to_owned()
        } else {
            format!(
                "no message names {}: another publisher sends them, or the robot has no such joint (make it `fixed`, as `init` does)",
                list(missing.iter().copied())
            )
        });
    }
    let named = pairs.iter().take(MAX_PAIRS);
    let named: Vec<String> = named
        .map(|(ours, theirs)| {
            format!("`{theirs}` of the messages is probably `{ours}` of the URDF")
        })
        .collect();
    let more = pairs.len().saturating_sub(MAX_PAIRS);
    let more = if more > 0 {
        format!(" (and {more} more)")
    } else {
        String::new()
    };
    Some(format!(
        "{}{more}: the names must be the same",
        named.join(", ")
    ))
}

/// Describes the prefix or suffix that distinguishes all names of one side from those of the other.
fn common_affix(wanted: &[String], found: &[String]) -> Option<String> {
    let all = |of: &[String], full: &dyn Fn(&str) -> String, to: &[String]| {
        of.iter().all(|name| to.contains(&full(name)))
    };
    let first = wanted.first()?;
    for name in found {
        for (long, short, whose) in [(name, first, "messages"), (first, name, "URDF")] {
            let (of, to) = if whose == "messages" {
                (wanted, found)
            } else {
                (found, wanted)
            };
            let enough = of.len() > 1 || of.len() == to.len();
            if let Some(prefix) = long.strip_suffix(short.as_str())
                && !prefix.is_empty()
                && enough
                && all(of, &|name| format!("{prefix}{name}"), to)
            {
                return Some(format!("the names of the {whose} begin with `{prefix}`"));
            }
            if let Some(suffix) = long.strip_prefix(short.as_str())
                && !suffix.is_empty()
                && enough
                && all(of, &|name| format!("{name}{suffix}"), to)
            {
                return Some(format!("the names of the {whose} end in `{suffix}`"));
            }
        }
    }
    None
}

/// Returns missing joints, each with its probable name in the messages.
fn pairs<'a>(
    missing: &[&'a String],
    wanted: &[String],
    found: &'a [String],
) -> Vec<(&'a String, &'a String)> {
    let mut free: Vec<&String> = found.iter().filter(|name| !wanted.contains(name)).collect();
    let mut pairs = Vec::new();
    for ours in missing {
        let nearest = free
            .iter()
            .enumerate()
            .map(|(at, theirs)| {
                (
                    at,
                    strsim::jaro_winkler(&ours.to_lowercase(), &theirs.to_lowercase()),
                )
            })
            .filter(|(_, similarity)| *similarity >= LEAST_SIMILARITY)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((at, _)) = nearest {
            pairs.push((*ours, free.swap_remove(at)));
        }
    }
    pairs
}

/// Joins the first few names: `a, b, c`.
pub(super) fn list<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    const MAX_LISTED: usize = 12;
    let names: Vec<&str> = names.into_iter().map(String::as_str).collect();
    let first = names[..names.len().min(MAX_LISTED)].join(", ");
    match names.len().saturating_sub(MAX_LISTED) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slip_of(wanted: &str, found: &str) -> Option<String> {
        let names =
            |text: &str| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
        slip(&names(wanted), &names(found))
    }

    #[test]
    fn each_difference_has_its_sentence() {
        for (wanted, found, expected) in [
            (
                "joint1 joint2",
                "left_joint1 left_joint2",
                "messages begin with `left_`",
            ),
            (
                "panda_joint1 panda_joint2",
                "joint1 joint2",
                "URDF begin with `panda_`",
            ),
            ("a b", "a_joint b_joint gripper", "messages end in `_joint`"),
            (
                "joint1 joint2 joint3",
                "joint_1 joint_2 joint_3",
                "`joint_1` of the messages is probably `joint1`",
            ),
            (
                "shoulder elbow wrist",
                "shoulder elbow wirst",
                "`wirst` of the messages is probably `wrist`",
            ),
            (
                "joint1 joint2 joint3",
                "joint1 joint2",
                "no message names joint3",
            ),
            ("joint1 joint2", "left_wheel right_wheel", "another robot"),
        ] {
            let slip = slip_of(wanted, found).unwrap();
            assert!(slip.contains(expected), "{wanted} / {found}: {slip}");
        }
    }

    #[test]
    fn more_joints_than_the_urdf_has_are_no_slip() {
        assert_eq!(slip_of("a b", "gripper b a"), None);
    }
}
