//! Labelled contacts of the recordings of a set, from a file of labels or from the contact topic.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use tauscope_archive::{ArchiveError, Recording, ros};
use tauscope_detect::{ContactKind, LabelledContact};
use tauscope_pipeline::suggest;

/// Content of `labels.json`; other keys are ignored.
#[derive(Debug, Clone, Deserialize)]
pub struct LabelsFile {
    /// Labels by the recording's name.
    pub recordings: BTreeMap<String, Truth>,
}

/// Labelled contacts of one recording; times in seconds from its first joint state.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub struct Truth {
    /// Length of the recording \[s\]; if absent, that of its samples.
    #[serde(default)]
    pub duration: Option<f64>,
    /// The contacts.
    #[serde(default)]
    pub events: Vec<TrueEvent>,
}

/// One contact.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub struct TrueEvent {
    /// Beginning \[s\].
    pub t_on: f64,
    /// End \[s\].
    pub t_off: f64,
    /// `contact`, `collision` or `cooperation`.
    #[serde(default = "contact")]
    pub kind: String,
    /// The touched link.
    #[serde(default)]
    pub link: Option<String>,
    /// Force on the robot at its peak, world frame \[N\].
    #[serde(default)]
    pub force: Option<[f64; 3]>,
    /// Whether it is too weak to be scored.
    #[serde(default)]
    pub ignore: bool,
    /// The person who cooperated.
    #[serde(default)]
    pub operator: Option<String>,
    /// Whether this person had cooperated before.
    #[serde(default)]
    pub experienced: Option<bool>,
    /// Kind of the contact during which this one began.
    #[serde(default)]
    pub during: Option<String>,
    /// Material that was hit.
    #[serde(default)]
    pub material: Option<String>,
    /// Motion of the robot at the hit.
    #[serde(default, rename = "move")]
    pub motion: Option<String>,
    /// Zone of the workspace in which it was hit.
    #[serde(default)]
    pub zone: Option<String>,
}

/// Kinds of contacts in labels.
pub const KINDS: [&str; 3] = ["contact", "collision", "cooperation"];

fn contact() -> String {
    "contact".to_owned()
}

impl TrueEvent {
    /// Converts to the label that a detector learns from; `start_ns` is the recording's first stamp.
    pub fn labelled(&self, start_ns: i64) -> LabelledContact {
        let ns = |t: f64| start_ns + (t * 1e9).round() as i64;
        LabelledContact {
            on_ns: ns(self.t_on),
            off_ns: ns(self.t_off),
            kind: match self.kind.as_str() {
                "collision" => ContactKind::Collision,
                "cooperation" => ContactKind::Cooperation,
                _ => ContactKind::Contact,
            },
            ignore: self.ignore,
        }
    }
}

impl Truth {
    /// Checks times and kinds; returns a description of the first error.
    pub fn check(&self) -> Result<(), String> {
        if let Some(duration) = self.duration
            && !(duration.is_finite() && duration >= 0.0)
        {
            return Err(format!("a `duration` of {duration} s"));
        }
        for (index, event) in self.events.iter().enumerate() {
            let (on, off) = (event.t_on, event.t_off);
            if !(on.is_finite() && off.is_finite() && on <= off) {
                return Err(format!("an event from {on} s to {off} s"));
            }
            let kinds = [Some(&event.kind), event.during.as_ref()];
            for kind in kinds.into_iter().flatten() {
                if !KINDS.contains(&kind.as_str()) {
                    let help = suggest::nearest(kind, KINDS)
                        .map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                    return Err(format!(
                        "event {}, at {on} s: there is no kind `{kind}`; the kinds are {}{help}",
                        index + 1,
                        suggest::list(KINDS)
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Reads a file of labels.
///
/// # Errors
/// A description of the first error.
pub fn read(path: &Path) -> Result<LabelsFile, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("cannot read: {error}"))?;
    let file: LabelsFile =
        serde_json::from_str(&text).map_err(|error| format!("these are no labels: {error}"))?;
    for (name, truth) in &file.recordings {
        truth
            .check()
            .map_err(|wrong| format!("recording `{name}`: {wrong}"))?;
    }
    Ok(file)
}

/// Reads the contacts that a topic of `std_msgs/msg/Bool` flags; `None` if the recording has no such topic. The
/// messages have no stamp, so their log time relative to `start_log_ns` is used.
///
/// # Errors
/// If the recording cannot be read.
pub fn from_topic(
    recording: &Recording,
    topic: &str,
    start_log_ns: i64,
) -> Result<Option<Truth>, ArchiveError> {
    if !recording.topics().iter().any(|each| each.name == topic) {
        return Ok(None);
    }
    recording.topic_of::<ros::Bool>(topic)?;
    let mut flags = Vec::new();
    let mut messages = recording.messages(&[topic])?;
    while let Some(message) = messages.next_message() {
        let message = match message {
            // Unreadable parts are counted when the joint states are read.
            Err(ArchiveError::Damaged(_)) => continue,
            other => other?,
        };
        let flag: ros::Bool = message.decode()?;
        flags.push((
            (message.log_time_ns - start_log_ns) as f64 * 1e-9,
            flag.data,
        ));
    }
    Ok(Some(Truth {
        duration: None,
        events: spans(&flags),
    }))
}

/// Intervals from the first to the last message of each run of set flags.
fn spans(flags: &[(f64, bool)]) -> Vec<TrueEvent> {
    let mut events: Vec<TrueEvent> = Vec::new();
    let mut open = false;
    for &(t, set) in flags {
        match events.last_mut() {
            Some(event) if set && open => event.t_off = t,
            _ if set => events.push(TrueEvent {
                t_on: t,
                t_off: t,
                kind: contact(),
                ..TrueEvent::default()
            }),
            _ => {}
        }
        open = set;
    }
    events
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_becomes_the_events_in_which_it_is_set() {
        let flags = [
            (0.0, false),
            (0.1, true),
            (0.2, true),
            (0.3, false),
            (0.4, true),
        ];
        let spans = spans(&flags);
        let times: Vec<_> = spans.iter().map(|e| (e.t_on, e.t_off)).collect();
        assert_eq!(times, [(0.1, 0.2), (0.4, 0.4)]);
        assert_eq!(spans[0].kind, "contact");
    }

    #[test]
    fn an_event_that_ends_before_it_begins_is_refused() {
        let event = TrueEvent {
            t_on: 2.0,
            t_off: 1.0,
            ..TrueEvent::default()
        };
        let truth = Truth {
            duration: None,
            events: vec![event],
        };
        assert_eq!(truth.check().unwrap_err(), "an event from 2 s to 1 s");
    }
}
