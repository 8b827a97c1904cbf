//! Comparison of two results over the same recordings: events that appeared, vanished or moved.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::read::{EventRow, RecordingRow, Results};

/// Change of an event from the first result to the second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Only the second result has it.
    Appeared,
    /// Only the first result has it.
    Vanished,
    /// Both results have it, with different time, kind, link or joints.
    Moved,
}

impl Change {
    /// Name of the change.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Appeared => "appeared",
            Self::Vanished => "vanished",
            Self::Moved => "moved",
        }
    }
}

/// An event in one result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Told {
    /// The stage that reported it.
    pub stage: String,
    /// Its detector.
    pub detector: String,
    /// `contact`, `collision`, …, or the effect of a change of the arm.
    pub kind: String,
    /// The touched or changed link, if estimated.
    pub link: Option<String>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// Stamp of the sample that raised the alarm, relative to the recording's first sample \[s\].
    pub t_s: f64,
    /// Stamp of the sample that ended it \[s\].
    pub t_off_s: f64,
    /// The largest score.
    pub peak_score: Option<f64>,
    /// Force on the robot in the world frame, if estimated \[N\].
    pub force_n: Option<[f64; 3]>,
}

/// An event that differs between the results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Kind of the difference.
    pub change: Change,
    /// The cell.
    pub cell: String,
    /// The recording's name.
    pub recording: String,
    /// SHA-256 of the recording.
    pub recording_sha256: String,
    /// The relevant part of the recording: from the earliest estimated beginning to the latest end \[ns since the
    /// epoch\].
    pub window_ns: (i64, i64),
    /// The event in the first result.
    pub a: Option<Told>,
    /// The event in the second result.
    pub b: Option<Told>,
}

impl Difference {
    /// The event in the newer result that has it.
    fn told(&self) -> Option<&Told> {
        self.b.as_ref().or(self.a.as_ref())
    }

    /// The link in the newer result that has the event; empty if none was estimated.
    pub fn link(&self) -> &str {
        self.told().and_then(|t| t.link.as_deref()).unwrap_or("")
    }

    /// The joints in the newer result that has the event.
    pub fn joints(&self) -> &[String] {
        self.told().map_or(&[], |told| &told.joints)
    }

    /// The differences in words; empty for an event that only one result has.
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

/// Numbers of differing events of a cell, link or joint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Only in the second result.
    pub appeared: usize,
    /// Only in the first.
    pub vanished: usize,
    /// In both, but different.
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

/// Comparison of two results.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Number of recordings that both results have.
    pub recordings: usize,
    /// Names of recordings that only the first result has.
    pub only_in_a: Vec<String>,
    /// Names of recordings that only the second result has.
    pub only_in_b: Vec<String>,
    /// Number of events of the first result in common recordings.
    pub events_a: usize,
    /// Number of events of the second result in common recordings.
    pub events_b: usize,
    /// Number of equal events.
    pub same: usize,
    /// Differences by cell.
    pub cells: BTreeMap<String, Counts>,
    /// Differences by cell and link; the link is empty if none was estimated.
    pub links: BTreeMap<String, BTreeMap<String, Counts>>,
    /// Differences by cell and joint; an event counts for each joint that detected it.
    pub joints: BTreeMap<String, BTreeMap<String, Counts>>,
    /// The differing events, ordered by cell, recording and time.
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
    /// The recording.
    pub recording: String,
}

/// Compares `b` with `a`. Events form a pair if their times overlap or are at most `tolerance_s` apart. Events of a
/// stage that both results have pair within this stage; events of all other stages pair with each other. A pair has
/// moved if its alarms are further apart than `tolerance_s`, or if kind, link or joints differ.
///
/// # Errors
/// If a result contains a recording twice.
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

/// Pairs each event with at most one event of the other result; the closest alarms pair first.
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
