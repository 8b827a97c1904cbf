//! Layouts that are recognised by the header: `NAME.position`, `NAME.velocity`, `NAME.effort`, and similar ones.

use super::units::{Quantity, split};
use super::{Column, Columns, CsvMapping};

/// Order of the joint's name and the word for the quantity in a header cell.
#[derive(Clone, Copy)]
enum Form {
    /// `NAME.position`.
    Behind(char),
    /// `position_NAME`.
    Before(char),
}

/// Forms that are recognised, the least ambiguous first: names of joints may contain underscores.
const FORMS: [Form; 4] = [
    Form::Behind('.'),
    Form::Behind('/'),
    Form::Behind('_'),
    Form::Before('_'),
];
/// Words for each quantity, in order of preference.
const POSITION: [&str; 2] = ["position", "pos"];
const VELOCITY: [&str; 2] = ["velocity", "vel"];
const EFFORT: [&str; 3] = ["effort", "torque", "current"];
/// Names of a time column, without its unit.
const TIME: [&str; 6] = ["time", "t", "timestamp", "stamp", "datetime", "__time"];
/// Words that mark a column as a command instead of a measurement.
const COMMANDED: [&str; 11] = [
    "commanded",
    "command",
    "commands",
    "cmd",
    "desired",
    "des",
    "target",
    "reference",
    "ref",
    "setpoint",
    "goal",
];
/// Further words for the quantities, from which the error for an unrecognised header suggests a mapping. They are too
/// short or too general to accept without confirmation.
const LIKELY: [(Quantity, &[&str]); 3] = [
    (
        Quantity::Velocity,
        &[
            "velocity",
            "velocities",
            "vel",
            "speed",
            "dq",
            "qd",
            "qdot",
            "omega",
        ],
    ),
    (
        Quantity::Effort,
        &[
            "effort", "efforts", "torque", "torques", "tau", "current", "currents",
        ],
    ),
    (
        Quantity::Position,
        &[
            "position",
            "positions",
            "pos",
            "angle",
            "angles",
            "q",
            "theta",
        ],
    ),
];

/// Layout of a table by its header.
pub(super) enum Layout {
    /// The mapping, and a sentence that says how it was recognised.
    Known(Box<CsvMapping>, String),
    /// Columns of positions without a time, the names of joints, or columns of some joints.
    Nearly {
        /// Reason why the header is not enough.
        reason: String,
        /// The text of a columns file that describes the table, as far as it is known.
        columns: String,
    },
    Unknown,
}

impl Layout {
    /// The layout of a table with these header cells.
    pub(super) fn of(header: &[String]) -> Self {
        let pairs = FORMS
            .iter()
            .flat_map(|form| POSITION.map(|word| (*form, word)));
        for (form, word) in pairs {
            let position = form.columns(header, Quantity::Position, word);
            if !position.is_empty() {
                return Self::named(header, form, word, &position);
            }
        }
        Self::likely(header)
    }

    /// The layout of a table whose header names the joints in this form, `word` being its word for `position`.
    fn named(header: &[String], form: Form, word: &str, position: &Named<'_>) -> Self {
        let velocity = form.first(header, Quantity::Velocity, &VELOCITY);
        let effort = form.first(header, Quantity::Effort, &EFFORT);
        // Such columns may be those of a sensor instead: none of them has a joint's name.
        let is_of_joints = |(_, columns): &(&str, Named<'_>)| {
            let mut joints = position.iter().map(|(joint, _)| joint);
            joints.any(|joint| cell_of(columns, joint).is_some())
        };
        let optional = [velocity, effort].map(|named| named.filter(is_of_joints));
        let is_whole = |joint: &String| {
            let mut named = optional.iter().flatten();
            named.all(|(_, columns)| cell_of(columns, joint).is_some())
        };
        let (joints, partial): (Vec<_>, Vec<_>) =
            (position.iter().map(|(joint, _)| joint.clone())).partition(is_whole);
        let cells = |columns: &Named<'_>| {
            let cells = joints.iter().filter_map(|joint| cell_of(columns, joint));
            cells.map(str::to_owned).collect::<Vec<_>>()
        };
        let [velocity, effort] = optional
            .each_ref()
            .map(|named| named.as_ref().map(|(_, columns)| cells(columns)));
        let twice = (1..joints.len()).find(|&i| joints[..i].contains(&joints[i]));
        let time = time_of(header);
        let reason = if let Some(twice) = twice {
            let joint = &joints[twice];
            format!("several columns hold the position of {joint}")
        } else if !partial.is_empty() {
            let joints = partial.join(", ");
            format!(
                "the velocity or the effort of {joints} is missing, and other joints have theirs"
            )
        } else if time.is_none() {
            no_time()
        } else {
            let words = optional.iter().flatten().map(|(word, _)| *word);
            let remark = form.remark(std::iter::once(word).chain(words), joints.len());
            let mapping = mapping(time, cells(position), velocity, effort, joints);
            return Self::Known(Box::new(mapping), remark);
        };
        let mapping = mapping(time, cells(position), velocity, effort, joints);
        let columns = text(&mapping);
        Self::Nearly { reason, columns }
    }

    /// A description of a table whose header has words for the quantities, but no names of joints.
    fn likely(header: &[String]) -> Self {
        let of = |wanted: Quantity| -> Vec<String> {
            let is_wanted = |cell: &&String| likely_quantity(cell) == Some(wanted);
            header.iter().filter(is_wanted).cloned().collect()
        };
        let position = of(Quantity::Position);
        if position.is_empty() {
            return Self::Unknown;
        }
        let optional = |quantity| Some(of(quantity)).filter(|cells| cells.len() == position.len());
        let [velocity, effort] = [Quantity::Velocity, Quantity::Effort].map(optional);
        let joints = (1..=position.len()).map(|number| format!("joint{number}"));
        let joints = joints.collect();
        let time = time_of(header);
        let reason = match time {
            Some(_) => "it does not name the joints".to_owned(),
            None => no_time(),
        };
        let columns = text(&mapping(time, position, velocity, effort, joints));
        Self::Nearly { reason, columns }
    }
}

/// Joints and their header cells, in the order of the header.
type Named<'a> = Vec<(String, &'a str)>;

impl Form {
    /// The joints and cells whose word for `quantity` is `word`.
    fn columns<'a>(self, header: &'a [String], quantity: Quantity, word: &str) -> Named<'a> {
        let columns = header.iter().filter_map(|cell| {
            let (base, _) = split(cell, quantity);
            let (joint, own) = match self {
                Self::Behind(between) => base.rsplit_once(between)?,
                Self::Before(between) => {
                    let (own, joint) = base.split_once(between)?;
                    (joint, own)
                }
            };
            if !own.eq_ignore_ascii_case(word) || is_commanded(joint) {
                return None;
            }
            // Exports of messages begin with the topic: `/joint_states/elbow/position`.
            let joint = match self {
                Self::Behind('/') => joint.rsplit('/').next()?,
                _ => joint,
            };
            let is_name = joint.contains(|c: char| !c.is_ascii_digit());
            is_name.then(|| (joint.to_owned(), cell.as_str()))
        });
        columns.collect()
    }

    /// The first of `words` that the header has in this form.
    fn first<'a>(
        self,
        header: &'a [String],
        quantity: Quantity,
        words: &[&'static str],
    ) -> Option<(&'static str, Named<'a>)> {
        let mut columns = words
            .iter()
            .map(|&word| (word, self.columns(header, quantity, word)));
        columns.find(|(_, columns)| !columns.is_empty())
    }

    fn remark<'a>(self, words: impl Iterator<Item = &'a str>, joints: usize) -> String {
        let patterns: Vec<_> = words
            .map(|word| match self {
                Self::Behind(between) => format!("NAME{between}{word}"),
                Self::Before(between) => format!("{word}{between}NAME"),
            })
            .collect();
        let patterns = match patterns.as_slice() {
            [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            one => one.concat(),
        };
        let plural = if joints == 1 { "joint" } else { "joints" };
        format!("The columns are recognised by their header as {patterns} of {joints} {plural}.")
    }
}

fn cell_of<'a>(columns: &Named<'a>, joint: &str) -> Option<&'a str> {
    let mut columns = columns.iter();
    let (_, cell) = columns.find(|(own, _)| own == joint)?;
    Some(cell)
}

fn no_time() -> String {
    format!("no column is called {}", TIME[..4].join(", "))
}

/// The mapping by header cells. Without a `time`, the first column is assumed to hold it.
fn mapping(
    time: Option<&str>,
    position: Vec<String>,
    velocity: Option<Vec<String>>,
    effort: Option<Vec<String>>,
    joints: Vec<String>,
) -> CsvMapping {
    let columns = |names| Columns {
        names: Some(names),
        ..Columns::default()
    };
    CsvMapping {
        time: Column {
            name: time.map(str::to_owned),
            number: time.is_none().then_some(1),
        },
        time_unit_ns: None,
        position: columns(position),
        velocity: velocity.map(columns),
        effort: effort.map(columns),
        joints: Some(joints),
        header: true,
        skip_lines: 0,
        delimiter: None,
    }
}

/// The text of a columns file with the mapping of [`mapping`].
fn text(mapping: &CsvMapping) -> String {
    let quoted = |name: &String| serde_json::Value::from(name.as_str()).to_string();
    let list = |names: &[String]| names.iter().map(quoted).collect::<Vec<_>>().join(", ");
    let time = match &mapping.time.name {
        Some(name) => format!("name: {}", quoted(name)),
        None => "number: 1".to_owned(),
    };
    let mut lines = vec!["header: true".to_owned(), format!("time: {{{time}}}")];
    let quantities = [
        ("position", Some(&mapping.position)),
        ("velocity", mapping.velocity.as_ref()),
        ("effort", mapping.effort.as_ref()),
    ];
    for (quantity, columns) in quantities {
        let names = columns.and_then(|columns| columns.names.as_deref());
        lines.extend(names.map(|names| format!("{quantity}: {{names: [{}]}}", list(names))));
    }
    let joints = mapping.joints.as_deref().unwrap_or_default();
    lines.push(format!("joints: [{}]", list(joints)));
    lines.join("\n")
}

/// The first header cell that names a time.
fn time_of(header: &[String]) -> Option<&str> {
    let is_time = |cell: &&String| {
        let (base, _) = split(cell, Quantity::Time);
        // numpy and rostopic write a sign of a comment before the first name.
        let base = base.trim_start_matches(['#', '%', ' ']);
        TIME.iter().any(|name| base.eq_ignore_ascii_case(name))
    };
    header.iter().find(is_time).map(String::as_str)
}

fn is_commanded(name: &str) -> bool {
    let mut words = words(name).into_iter();
    words.any(|word| COMMANDED.contains(&word.as_str()))
}

/// The quantity that a header cell has a word for.
fn likely_quantity(cell: &str) -> Option<Quantity> {
    let words = words(cell);
    if is_commanded(cell) {
        return None;
    }
    let has =
        |of: &&(Quantity, &[&str])| of.1.iter().any(|&own| words.iter().any(|word| word == own));
    LIKELY.iter().find(has).map(|(quantity, _)| *quantity)
}

/// The words of a header cell in lower case: `Position, J1 [rad]` has position, j, 1 and rad.
fn words(cell: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in cell.chars() {
        let is_border = !c.is_alphanumeric()
            || c.is_ascii_digit() != before.is_ascii_digit()
            || (c.is_uppercase() && before.is_lowercase());
        if is_border {
            words.push(String::new());
        }
        if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}
