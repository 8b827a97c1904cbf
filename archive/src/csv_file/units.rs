//! Units in header cells: `q1 [deg]`, `time (ms)`, `stamp_ns`.

use std::f64::consts::PI;

/// Quantity in a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Time,
    Position,
    Velocity,
    Effort,
}

/// A unit that a header may name.
#[derive(Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) name: &'static str,
    quantity: Quantity,
    pub(super) dimension: Dimension,
    /// Factor to ns for a time, otherwise to rad, m, rad/s, m/s, N m, N or A.
    pub(super) factor: f64,
    /// Spellings in brackets, normalised by [`plain`].
    brackets: &'static [&'static str],
    /// Spellings after an underscore. Single letters except `s` are excluded, because they may be names of joints.
    suffixes: &'static [&'static str],
}

/// Dimension of a unit. The columns of a quantity may mix dimensions (rotary and sliding joints), but not units of
/// one dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Dimension {
    Time,
    Angle,
    Length,
    Torque,
    Current,
    Force,
}

use Dimension::{Angle, Current, Force, Length, Time, Torque};

impl Unit {
    /// Returns the unit to which values in this one are converted; `None` if they are not converted.
    pub(super) fn target(&self) -> Option<&'static str> {
        let mut alike = UNITS
            .iter()
            .filter(|unit| (unit.quantity, unit.dimension) == (self.quantity, self.dimension));
        // The first unit of each dimension has the factor 1.
        let target = alike.next().map(|unit| unit.name);
        target.filter(|&target| target != self.name)
    }

    /// Returns whether the columns of one quantity must not mix the two units.
    pub(super) fn contradicts(&self, other: &Self) -> bool {
        // A motor current is treated as a torque: columns in A and columns in N m must not be mixed.
        let dimension = |unit: &Self| match unit.dimension {
            Current => Torque,
            dimension => dimension,
        };
        self != other && dimension(self) == dimension(other)
    }
}

const DEG: f64 = PI / 180.0;
/// One revolution per minute \[rad/s\].
const RPM: f64 = PI / 30.0;

/// All units. U+FFFD stands for `°` or `µ` in a table that is not UTF-8.
#[rustfmt::skip]
const UNITS: [Unit; 19] = [
    unit("s", Quantity::Time, Time, 1e9, &["s", "sec", "second", "seconds"], &["s", "sec"]),
    unit("ms", Quantity::Time, Time, 1e6, &["ms", "msec", "milliseconds"], &["ms", "msec"]),
    unit("us", Quantity::Time, Time, 1e3, &["us", "usec", "microseconds", "\u{fffd}s"], &["us", "usec"]),
    unit("ns", Quantity::Time, Time, 1.0, &["ns", "nsec", "nanoseconds"], &["ns", "nsec"]),
    unit("rad", Quantity::Position, Angle, 1.0, &["rad", "radian", "radians"], &["rad"]),
    unit("deg", Quantity::Position, Angle, DEG, &["deg", "degree", "degrees", "\u{fffd}"], &["deg"]),
    unit("m", Quantity::Position, Length, 1.0, &["m"], &[]),
    unit("mm", Quantity::Position, Length, 1e-3, &["mm"], &["mm"]),
    unit("rad/s", Quantity::Velocity, Angle, 1.0, &["rad/s", "rad/sec", "rads-1", "rad"], &["rad_s", "rad"]),
    unit("deg/s", Quantity::Velocity, Angle, DEG, &["deg/s", "deg/sec", "degs-1", "\u{fffd}/s", "deg"], &["deg_s", "deg"]),
    unit("rpm", Quantity::Velocity, Angle, RPM, &["rpm", "1/min"], &["rpm"]),
    unit("m/s", Quantity::Velocity, Length, 1.0, &["m/s"], &[]),
    unit("mm/s", Quantity::Velocity, Length, 1e-3, &["mm/s"], &["mm_s"]),
    unit("N m", Quantity::Effort, Torque, 1.0, &["nm"], &["nm"]),
    unit("mN m", Quantity::Effort, Torque, 1e-3, &["mnm"], &["mnm"]),
    unit("N cm", Quantity::Effort, Torque, 1e-2, &["ncm"], &["ncm"]),
    unit("A", Quantity::Effort, Current, 1.0, &["a", "amp", "ampere"], &[]),
    unit("mA", Quantity::Effort, Current, 1e-3, &["ma"], &["ma"]),
    unit("N", Quantity::Effort, Force, 1.0, &["n"], &[]),
];

const fn unit(
    name: &'static str,
    quantity: Quantity,
    dimension: Dimension,
    factor: f64,
    brackets: &'static [&'static str],
    suffixes: &'static [&'static str],
) -> Unit {
    Unit {
        name,
        quantity,
        dimension,
        factor,
        brackets,
        suffixes,
    }
}

/// Splits a header cell into its name and its unit, if it has a unit of `quantity`.
pub(super) fn split(cell: &str, quantity: Quantity) -> (String, Option<&'static Unit>) {
    for (start, end) in groups(cell) {
        let unit = in_brackets(&cell[start + 1..end], quantity);
        if unit.is_some() || is_last(cell, (start, end)) {
            let base = format!("{}{}", cell[..start].trim_end(), &cell[end + 1..]);
            return (base.trim().trim_end_matches('_').to_owned(), unit);
        }
    }
    let lower = cell.to_ascii_lowercase();
    let suffixes = UNITS.iter().filter(|unit| unit.quantity == quantity);
    let suffixes = suffixes.flat_map(|unit| unit.suffixes.iter().map(move |suffix| (unit, suffix)));
    for (unit, suffix) in suffixes {
        let rest = lower.strip_suffix(suffix);
        if let Some(base) = rest.and_then(|rest| rest.strip_suffix('_')) {
            return (cell[..base.len()].to_owned(), Some(unit));
        }
    }
    (cell.to_owned(), None)
}

/// Returns a unit in brackets that belongs to another quantity than `quantity`.
pub(super) fn contradiction(cell: &str, quantity: Quantity) -> Option<&'static Unit> {
    groups(cell).find_map(|(start, end)| {
        let group = plain(&cell[start + 1..end]);
        // A single letter may mean something else, such as "measured" in `q (m)`.
        if group.len() < 2 || in_brackets(&group, quantity).is_some() {
            return None;
        }
        let mut others = UNITS.iter().filter(|unit| unit.quantity != quantity);
        others.find(|unit| unit.brackets.contains(&group.as_str()))
    })
}

/// The text in brackets at the end of a cell.
pub(super) fn in_last_brackets(cell: &str) -> Option<&str> {
    let mut groups = groups(cell);
    let (start, end) = groups.find(|group| is_last(cell, *group))?;
    Some(&cell[start + 1..end])
}

/// Whether a group of brackets ends a cell and is no index such as `[0]`.
fn is_last(cell: &str, (start, end): (usize, usize)) -> bool {
    let is_index = cell[start + 1..end]
        .bytes()
        .all(|byte| byte.is_ascii_digit());
    start > 0 && cell[end + 1..].trim().is_empty() && !is_index
}

fn in_brackets(text: &str, quantity: Quantity) -> Option<&'static Unit> {
    let text = plain(text);
    let mut units = UNITS.iter().filter(|unit| unit.quantity == quantity);
    units.find(|unit| unit.brackets.contains(&text.as_str()))
}

/// Byte places of the opening and the closing bracket of each group.
fn groups(cell: &str) -> impl Iterator<Item = (usize, usize)> {
    cell.match_indices(['[', '(']).filter_map(|(start, open)| {
        let close = if open == "[" { ']' } else { ')' };
        let end = cell[start..].find(close)?;
        Some((start, start + end))
    })
}

/// A unit in lower case, without blanks and signs of multiplication, `°` as `deg` and `µ` as `u`.
fn plain(text: &str) -> String {
    let text = text.replace('°', "deg").replace(['µ', 'μ'], "u");
    let is_kept = |c: &char| !c.is_whitespace() && !"·⋅*.^".contains(*c);
    text.to_lowercase().chars().filter(is_kept).collect()
}
