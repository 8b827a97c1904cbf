//! Detection of the format and the unit of a table's time column.

use super::limits::TIME_S;
use super::rows::{Row, Rows};
use super::time::{Clock, date_ns};

const NS_PER_S: f64 = 1e9;
/// Candidate units, longest first, of numbers that cannot be seconds: name and length \[ns\].
const UNITS: [(&str, u64); 3] = [("ms", 1_000_000), ("us", 1_000), ("ns", 1)];
/// Range of plausible row rates; a unit that leads to another rate is rejected \[Hz\].
/// Chosen: interfaces of robots have 10 Hz to 8 kHz. A slower log is read in seconds unless its motion excludes them.
const RATES_HZ: [f64; 2] = [5.0, 20_000.0];
/// Range of positions above which a joint is classified as moving \[rad, m\].
/// Chosen: 100 times the noise of an encoder's position.
const MOVED: f64 = 0.1;
/// Largest absolute position that is used to determine the unit \[rad, m\].
/// Chosen: 150 turns; positions beyond it are broken data.
const FARTHEST: f64 = 1e3;
/// Minimum peak speed of a moving joint \[rad/s, m/s\].
/// Derived: no arm's joint is faster than 10 rad/s, which is 0.01 rad/s if milliseconds are read as seconds.
const SLOWEST_PER_S: f64 = 0.01;
/// Earliest time that is read as a date: the start of the year 2000 \[s since the epoch\].
/// Chosen: no file format for joint states is older.
const YEAR_2000_S: f64 = 946_684_800.0;
/// Maximum number of time steps from whose median the row rate follows.
/// Resolution: bounds memory.
const MAX_STEPS: usize = 1000;

/// Determines the clock of a table from the first of: dates in the first row, a unit in the columns file (`unit_ns`),
/// a unit in the header, the motion of the arm. Returns it with a remark for the user on how it was determined.
pub(super) fn clock_of(mut rows: Rows, unit_ns: Option<u64>) -> (Clock, Option<String>) {
    if rows
        .first_time()
        .is_some_and(|cell| date_ns(cell).is_some())
    {
        let remark = "Time is read as ISO 8601 dates; dates without a time zone are in UTC.";
        return (Clock::Dates, Some(remark.to_owned()));
    }
    if let Some(unit_ns) = unit_ns {
        return (Clock::Numbers { unit_ns }, None);
    }
    if let Some(unit_ns) = rows.headed_unit_ns() {
        let unit = UNITS.iter().find(|(_, own_ns)| *own_ns == unit_ns);
        let remark = unit.map(|(unit, _)| format!("Time is in {unit}, as the header says."));
        return (Clock::Numbers { unit_ns }, remark);
    }
    let mut motion = Motion::default();
    // An error ends the survey; the check of all rows reports it.
    while let Ok(Row::State { .. }) = rows.next_raw() {
        let Some(time) = rows.raw_time() else { break };
        let before = motion.steps.len();
        motion.add(time, &rows.state().position);
        let is_full = before < MAX_STEPS && motion.steps.len() == MAX_STEPS;
        // Only a rate that is too low for seconds needs the peak speed over the whole table.
        if is_full && motion.is_fast() {
            break;
        }
    }
    let (unit_ns, remark) = motion.unit();
    (Clock::Numbers { unit_ns }, remark)
}

/// Times in an unknown unit, and the positions at them.
#[derive(Debug, Default)]
struct Motion {
    first: f64,
    last: f64,
    /// The first [`MAX_STEPS`] positive time steps.
    steps: Vec<f64>,
    /// Position of each joint at the last change of the time.
    before: Vec<f64>,
    /// Lowest and highest position of each joint.
    ranges: Vec<(f64, f64)>,
    /// Highest speed of a joint between two times \[rad or m per unit\].
    fastest: f64,
}

impl Motion {
    fn add(&mut self, time: f64, position: &[f64]) {
        if self.ranges.is_empty() {
            self.first = time;
            self.last = time;
            self.before = position.to_vec();
            self.ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); position.len()];
        }
        for ((low, high), &value) in self.ranges.iter_mut().zip(position) {
            if value.abs() <= FARTHEST {
                *low = low.min(value);
                *high = high.max(value);
            }
        }
        let step = time - self.last;
        if step > 0.0 {
            for (&before, &value) in self.before.iter().zip(position) {
                // False for NaN.
                if before.abs() <= FARTHEST && value.abs() <= FARTHEST {
                    self.fastest = self.fastest.max((value - before).abs() / step);
                }
            }
            if self.steps.len() < MAX_STEPS {
                self.steps.push(step);
            }
            self.last = time;
            self.before.copy_from_slice(position);
        }
    }

    /// The median time between two rows with different times.
    fn step(&self) -> Option<f64> {
        let mut steps = self.steps.clone();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied()
    }

    /// Whether the rows have a rate that robots have if the time is in seconds.
    fn is_fast(&self) -> bool {
        self.step().is_none_or(|step| step * RATES_HZ[0] <= 1.0)
    }

    /// The unit \[ns\], and a sentence that says why.
    fn unit(&self) -> (u64, Option<String>) {
        let second = 1_000_000_000;
        let Some(step) = self.step() else {
            return (second, None);
        };
        let can_be_seconds = self.last <= TIME_S;
        if can_be_seconds && self.is_fast() {
            return (second, None);
        }
        let has_moved = self.ranges.iter().any(|(low, high)| high - low > MOVED);
        let is_slow = |unit_s: f64| has_moved && self.fastest < SLOWEST_PER_S * unit_s;
        // Two digits of a small number.
        let speed = format!("{:.1e}", self.fastest)
            .parse()
            .unwrap_or(self.fastest);
        let doubt =
            || format!("The time has no unit and is read as seconds: its rows are {step} s apart.");
        if can_be_seconds && !is_slow(1.0) {
            return (second, Some(doubt()));
        }
        let fitting = UNITS.iter().filter(|(_, unit_ns)| {
            let unit_s = *unit_ns as f64 / NS_PER_S;
            let rate_hz = 1.0 / (step * unit_s);
            let is_date = self.first * unit_s >= YEAR_2000_S;
            self.last * unit_s <= TIME_S
                && rate_hz <= RATES_HZ[1]
                && (rate_hz >= RATES_HZ[0] || is_date)
        });
        let moving = |(_, unit_ns): &&(&str, u64)| !is_slow(*unit_ns as f64 / NS_PER_S);
        match fitting.clone().find(moving).or(fitting.clone().next()) {
            None => (second, Some(doubt())),
            Some((unit, unit_ns)) => {
                let reason = if can_be_seconds {
                    format!("as seconds the arm would move at most {speed} rad/s")
                } else {
                    format!("as seconds, {} would be a date after 2038", self.last)
                };
                (*unit_ns, Some(format!("Time is in {unit}: {reason}.")))
            }
        }
    }
}
