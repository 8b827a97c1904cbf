//! Irregularities of the recordings of a set taken together.

use std::collections::BTreeMap;

use tauscope_bus::{TwinState, flags};
use tauscope_pipeline::suggest;

use crate::input::Request;
use crate::recording::{Named, Role};
use crate::twin::is_free;

/// Contact-free time below which learning is reported as unreliable \[s\].
/// Physical: a few movements of an arm.
const LITTLE_S: f64 = 5.0;
/// Range of positions in a recording below which a joint is at rest \[rad or m\].
/// Physical: a joint under position control moves by less, with steps of the encoder included.
const STILL: f64 = 0.002;
/// Range of positions in a recording above which a joint moves \[rad or m\].
/// Chosen: 50 times [`STILL`], so that a joint in between causes no note.
const MOVES: f64 = 0.1;
/// Relative tolerance of a rate from the nominal one, and of the train recordings' length from that of their cycles.
/// Chosen: jitter of the stamps and a part of a cycle stay below; another rate, or one cycle of fewer than twenty,
/// does not.
const DIFFERS: f64 = 0.05;

/// Sums and extremes over the recordings of a role.
#[derive(Debug, Default)]
struct OfRole {
    recordings: usize,
    /// Length \[s\].
    length_s: f64,
    /// Contact-free time in which the twin's filters have settled \[s\].
    free_s: f64,
    /// Largest range of positions of each joint within a recording \[rad or m\].
    travel: Vec<f64>,
}

/// Sums over all recordings.
#[derive(Debug, Default)]
pub struct Totals {
    train: OfRole,
    validation: OfRole,
    test: OfRole,
    /// Sample rates by recording \[Hz\].
    rates_hz: Vec<(String, f64)>,
    /// Recordings in which the effort of a joint never changes, by joint.
    constant: BTreeMap<usize, Vec<String>>,
}

impl Totals {
    /// Adds the samples of a recording.
    pub fn add(&mut self, recording: &Named, samples: &[TwinState]) {
        let [Some(first), Some(last)] = [samples.first(), samples.last()] else {
            return;
        };
        let of_role = match recording.role {
            Role::Train => &mut self.train,
            Role::Validation => &mut self.validation,
            Role::Test => &mut self.test,
        };
        let length_s = (last.header.stamp_ns - first.header.stamp_ns) as f64 / 1e9;
        let free = samples.iter().filter(|sample| {
            sample.header.has(flags::READY) && is_free(recording, sample.header.stamp_ns)
        });
        of_role.recordings += 1;
        of_role.length_s += length_s;
        of_role.free_s += length_s * free.count() as f64 / samples.len() as f64;
        for joint in 0..first.header.joint_count as usize {
            let travel = range(samples.iter().map(|sample| sample.position[joint]));
            if of_role.travel.len() <= joint {
                of_role.travel.push(0.0);
            }
            of_role.travel[joint] = of_role.travel[joint].max(travel);
            let measured = (samples.iter())
                .filter(|sample| sample.header.has(flags::EFFORT_MEASURED))
                .map(|sample| sample.effort[joint]);
            if samples.len() > 1 && range(measured) <= 0.0 {
                let names = self.constant.entry(joint).or_default();
                names.push(recording.name.clone());
            }
        }
        if let Some(rate_hz) = rate_hz(samples) {
            self.rates_hz.push((recording.name.clone(), rate_hz));
        }
    }

    /// Remarks for the reader.
    pub fn notes(&self, request: &Request) -> Vec<String> {
        let names = &request.cell.facts.joint_names;
        let mut notes = Vec::new();
        notes.extend(self.another_rate(request.set.rate_hz));
        notes.extend(self.other_cycles(request));
        notes.extend(self.little());
        let mut alike: BTreeMap<&[String], Vec<&str>> = BTreeMap::new();
        for (joint, recordings) in &self.constant {
            alike.entry(recordings).or_default().push(&names[*joint]);
        }
        for (recordings, joints) in alike {
            let recordings: Vec<&str> = recordings.iter().map(String::as_str).collect();
            notes.push(format!(
                "the effort of {} never changes in {}: no detector can notice a contact there",
                suggest::some(&joints),
                suggest::some(&recordings)
            ));
        }
        let travels = self.train.travel.iter().zip(&self.test.travel).zip(names);
        let stand: Vec<&str> = travels
            .filter(|((train, test), _)| **train < STILL && **test > MOVES)
            .map(|(_, name)| name.as_str())
            .collect();
        if !stand.is_empty() {
            notes.push(format!(
                "still in the train recordings, but not in the test recordings: {}; the effort of their motion was not learnt",
                suggest::some(&stand)
            ));
        }
        notes
    }

    fn another_rate(&self, nominal_hz: Option<f64>) -> Option<String> {
        let nominal_hz = nominal_hz?;
        let mut others = (self.rates_hz.iter())
            .filter(|(_, rate_hz)| (rate_hz / nominal_hz - 1.0).abs() > DIFFERS);
        let (name, rate_hz) = others.next()?;
        Some(format!(
            "`rate_hz` is {nominal_hz}, and {} of {} recordings hold another number of samples a second ({name}: {rate_hz:.1}): their stamps count",
            1 + others.count(),
            self.rates_hz.len()
        ))
    }

    fn other_cycles(&self, request: &Request) -> Option<String> {
        let cycles = f64::from(request.set.learning_cycles?);
        let found = self.train.length_s / request.set.cycle_s?;
        ((found / cycles - 1.0).abs() > DIFFERS).then(|| {
            format!(
                "`learning_cycles` is {cycles}, and the train recordings hold {found:.1} cycles: detectors learn from all of them"
            )
        })
    }

    fn little(&self) -> Vec<String> {
        let is_little = |of: &OfRole| of.recordings > 0 && of.free_s < LITTLE_S;
        let mut notes = Vec::new();
        if is_little(&self.train) {
            notes.push(format!(
                "the train recordings hold {:.1} s in which nothing touches the robot and the filters have settled: what is learnt from so little is unreliable",
                self.train.free_s
            ));
        }
        let (what, measured) = match self.validation.recordings {
            0 => ("train", &self.train),
            _ => ("validation", &self.validation),
        };
        if is_little(measured) {
            notes.push(format!(
                "thresholds are set on {:.1} s of the {what} recordings: how often they are exceeded by chance is not known",
                measured.free_s
            ));
        }
        notes
    }
}

/// Difference between the largest and the smallest value.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let ends = values.fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(least, most), value| (least.min(value), most.max(value)),
    );
    ends.1 - ends.0
}

/// Sample rate \[Hz\], from the median time step, which is robust to gaps.
fn rate_hz(samples: &[TwinState]) -> Option<f64> {
    let stamps = samples.windows(2);
    let mut steps_ns: Vec<i64> = stamps
        .map(|pair| pair[1].header.stamp_ns - pair[0].header.stamp_ns)
        .collect();
    steps_ns.sort_unstable();
    let median_ns = *steps_ns.get(steps_ns.len() / 2)?;
    (median_ns > 0).then(|| 1e9 / median_ns as f64)
}
