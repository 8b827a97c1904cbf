//! Two results over the same recordings: which events appeared, vanished and moved.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::read::{EventRow, RecordingRow, Results};

/// What became of an event from the first result to the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Only the second result has it.
    Appeared,
    /// Only the first result has it.
    Vanished,
    /// Both have it, with another time, kind, link or joints.
    Moved,
}

impl Change {
    /// In words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Appeared => "appeared",
            Self::Vanished => "vanished",
            Self::Moved => "moved",
        }
    }
}

/// An event as one result has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Told {
    /// The stage that told it.
    pub stage: String,
    /// Its detector.
    pub detector: String,
    /// `contact`, `collision`, …, or the effect of a change of the arm.
    pub kind: String,
    /// The touched or changed link, where estimated.
    pub link: Option<String>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// Stamp of the sample that raised the alarm, from the first sample of the recording on \[s\].
    pub t_s: f64,
    /// Stamp of the sample that ended it \[s\].
    pub t_off_s: f64,
    /// The largest score.
    pub peak_score: Option<f64>,
    /// Force on the robot, world frame \[N\], where estimated.
    pub force_n: Option<[f64; 3]>,
}

/// An event that is not the same in both results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// What became of it.
    pub change: Change,
    /// The cell.
    pub cell: String,
    /// The recording's name.
    pub recording: String,
    /// SHA-256 of the recording.
    pub recording_sha256: String,
    /// The part of the recording to look at: from the estimated beginning to the end, in either result \[ns since the
    /// epoch\].
    pub window_ns: (i64, i64),
    /// As the first result has it.
    pub a: Option<Told>,
    /// As the second result has it.
    pub b: Option<Told>,
}

impl Difference {
    /// As the newer result that has it tells it.
    fn told(&self) -> Option<&Told> {
        self.b.as_ref().or(self.a.as_ref())
    }

    /// The link of the newer result that has the event; empty where none was estimated.
    pub fn link(&self) -> &str {
        self.told().and_then(|t| t.link.as_deref()).unwrap_or("")
    }

    /// The joints of the newer result that has the event.
    pub fn joints(&self) -> &[String] {
        self.told().map_or(&[], |told| &told.joints)
    }

    /// What moved, in words; empty for an event that only one result has.
    pub fn what_moved(&self) -> Vec<String> {
        let (Some(a), Some(b)) = (&self.a, &self.b) else {
            return Vec::new();
        };
        let mut words = vec![format!("{:+.3} s", b.t_s - a.t_s)];
        let or_none = |link: &Option<String>| link.clone().unwrap_or_else(|| "no link".to_owned());
        if a.kind != b.kind {
            words.push(format!("{} to {}", a.kind, b.kind));
        }
        if a.link != b.link {
            words.push(format!("{} to {}", or_none(&a.link), or_none(&b.link)));
        }
        if a.joints != b.joints {
            words.push(format!("{} to {}", a.joints.join(" "), b.joints.join(" ")));
        }
        words
    }
}

/// How many events of one place are not the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Only in the second result.
    pub appeared: usize,
    /// Only in the first.
    pub vanished: usize,
    /// In both, and not the same.
    pub moved: usize,
}

impl Counts {
    fn add(&mut self, change: Change) {
        match change {
            Change::Appeared => self.appeared += 1,
            Change::Vanished => self.vanished += 1,
            Change::Moved => self.moved += 1,
        }
    }
}

/// Two results beside each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Recordings that both results have.
    pub recordings: usize,
    /// Names of those that only the first has.
    pub only_in_a: Vec<String>,
    /// Names of those that only the second has.
    pub only_in_b: Vec<String>,
    /// Events of the first result in recordings that both have.
    pub events_a: usize,
    /// Events of the second.
    pub events_b: usize,
    /// Events that are the same.
    pub same: usize,
    /// By cell.
    pub cells: BTreeMap<String, Counts>,
    /// By cell and link; the link is empty where none was estimated.
    pub links: BTreeMap<String, BTreeMap<String, Counts>>,
    /// By cell and joint; an event counts for each joint that detected it.
    pub joints: BTreeMap<String, BTreeMap<String, Counts>>,
    /// The events that are not the same, by cell, recording and time.
    pub differences: Vec<Difference>,
}

/// A result with two files for one recording.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{result} holds several results of the recording `{recording}`: give each pipeline a folder of its own"
)]
pub struct Ambiguous {
    /// `A` or `B`.
    pub result: &'static str,
    /// Which recording.
    pub recording: String,
}

/// Compares `b` with `a`. Events pair where their times overlap or are no more than `tolerance_s` apart, those of one
/// stage with each other, and those of stages that only one result has among themselves. A pair whose alarms are
/// further apart than that, or of another kind, link or joints, has moved.
///
/// # Errors
/// If a result has a recording twice.
pub fn compare(a: &Results, b: &Results, tolerance_s: f64) -> Result<Comparison, Ambiguous> {
    let (of_a, of_b) = (by_recording(a, "A")?, by_recording(b, "B")?);
    let only = |of: &BTreeMap<&str, _>, other: &BTreeMap<&str, (&RecordingRow, Vec<&EventRow>)>| {
        let names = of.iter().filter(|(sha256, _)| !other.contains_key(*sha256));
        let names = names.map(|(_, (row, _)): (_, &(&RecordingRow, Vec<&EventRow>))| row);
        names.map(|row| row.recording.clone()).collect()
    };
    let mut comparison = Comparison {
        recordings: 0,
        only_in_a: only(&of_a, &of_b),
        only_in_b: only(&of_b, &of_a),
        events_a: 0,
        events_b: 0,
        same: 0,
        cells: BTreeMap::new(),
        links: BTreeMap::new(),
        joints: BTreeMap::new(),
        differences: Vec::new(),
    };
    let stages = |results: &Results| -> BTreeSet<String> {
        results.events.iter().map(|e| e.stage.clone()).collect()
    };
    let in_both: BTreeSet<String> = &stages(a) & &stages(b);
    let tolerance_ns = (tolerance_s * 1e9) as i64;
    for (sha256, (recording, events_a)) in &of_a {
        let Some((_, events_b)) = of_b.get(sha256) else {
            continue;
        };
        comparison.recordings += 1;
        comparison.events_a += events_a.len();
        comparison.events_b += events_b.len();
        for (a, b) in pairs(events_a, events_b, &in_both, tolerance_ns) {
            match difference(recording, a, b, tolerance_ns) {
                Some(difference) => comparison.differences.push(difference),
                None => comparison.same += 1,
            }
        }
    }
    comparison.differences.sort_by(|a, b| {
        let key = |d: &Difference| (d.cell.clone(), d.recording.clone(), d.window_ns);
        key(a).cmp(&key(b))
    });
    count(&mut comparison);
    Ok(comparison)
}

type ByRecording<'a> = BTreeMap<&'a str, (&'a RecordingRow, Vec<&'a EventRow>)>;

fn by_recording<'a>(
    results: &'a Results,
    result: &'static str,
) -> Result<ByRecording<'a>, Ambiguous> {
    let mut all = ByRecording::new();
    for row in &results.recordings {
        if all.insert(&row.sha256, (row, Vec::new())).is_some() {
            let recording = row.recording.clone();
            return Err(Ambiguous { result, recording });
        }
    }
    for event in &results.events {
        if let Some((_, events)) = all.get_mut(event.sha256.as_str()) {
            events.push(event);
        }
    }
    Ok(all)
}

type Pair<'a> = (Option<&'a EventRow>, Option<&'a EventRow>);

/// Each event once: with the other result's that it belongs to, or alone. The closest alarms pair first.
fn pairs<'a>(
    a: &[&'a EventRow],
    b: &[&'a EventRow],
    in_both: &BTreeSet<String>,
    tolerance_ns: i64,
) -> Vec<Pair<'a>> {
    let comparable = |a: &EventRow, b: &EventRow| {
        a.stage == b.stage || !(in_both.contains(&a.stage) || in_both.contains(&b.stage))
    };
    let mut candidates = Vec::new();
    for (i, one) in a.iter().enumerate() {
        for (j, other) in b.iter().enumerate() {
            let begin = |e: &EventRow| e.contact_ns.min(e.t_ns).saturating_sub(tolerance_ns);
            let overlap = begin(one) <= other.end_ns && begin(other) <= one.end_ns;
            if overlap && comparable(one, other) {
                candidates.push((one.t_ns.abs_diff(other.t_ns), i, j));
            }
        }
    }
    candidates.sort_unstable();
    let (mut of_a, mut of_b) = (vec![None; a.len()], vec![false; b.len()]);
    for (_, i, j) in candidates {
        if of_a[i].is_none() && !of_b[j] {
            of_a[i] = Some(j);
            of_b[j] = true;
        }
    }
    let with_a = a
        .iter()
        .zip(of_a)
        .map(|(&one, j)| (Some(one), j.map(|j| b[j])));
    let alone = b.iter().zip(of_b).filter(|(_, paired)| !paired);
    with_a
        .chain(alone.map(|(&other, _)| (None, Some(other))))
        .collect()
}

fn difference(
    recording: &RecordingRow,
    a: Option<&EventRow>,
    b: Option<&EventRow>,
    tolerance_ns: i64,
) -> Option<Difference> {
    let change = match (a, b) {
        (Some(a), Some(b)) => {
            let near = a.t_ns.abs_diff(b.t_ns) <= tolerance_ns.unsigned_abs();
            if near && a.kind == b.kind && a.link == b.link && a.joints == b.joints {
                return None;
            }
            Change::Moved
        }
        (None, Some(_)) => Change::Appeared,
        (Some(_), None) => Change::Vanished,
        (None, None) => return None,
    };
    let both = || [a, b].into_iter().flatten();
    let from_ns = both().map(|event| event.contact_ns.min(event.t_ns)).min();
    let to_ns = both().map(|event| event.end_ns).max();
    let told = |event: &EventRow| {
        let seconds = |ns: i64| ns.saturating_sub(recording.t_ns) as f64 * 1e-9;
        Told {
            stage: event.stage.clone(),
            detector: event.detector.clone(),
            kind: event.kind.clone(),
            link: event.link.clone(),
            joints: event.joints.clone(),
            t_s: seconds(event.t_ns),
            t_off_s: seconds(event.end_ns),
            peak_score: event.peak_score,
            force_n: event.force_n,
        }
    };
    Some(Difference {
        change,
        cell: recording.cell.clone(),
        recording: recording.recording.clone(),
        recording_sha256: recording.sha256.clone(),
        window_ns: (from_ns.unwrap_or_default(), to_ns.unwrap_or_default()),
        a: a.map(told),
        b: b.map(told),
    })
}

fn count(comparison: &mut Comparison) {
    for difference in &comparison.differences {
        let (cell, change) = (&difference.cell, difference.change);
        comparison
            .cells
            .entry(cell.clone())
            .or_default()
            .add(change);
        let links = comparison.links.entry(cell.clone()).or_default();
        links
            .entry(difference.link().to_owned())
            .or_default()
            .add(change);
        let joints = comparison.joints.entry(cell.clone()).or_default();
        for joint in difference.joints() {
            joints.entry(joint.clone()).or_default().add(change);
        }
    }
}

#[cfg(test)]
mod tests;
