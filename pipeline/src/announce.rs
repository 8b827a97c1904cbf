//! Reports the events of detect and explain stages to the supervisor as they occur.

mod clock;
pub mod commands;

use tauscope_bus::shell;
use tauscope_bus::{
    Contact, ContactFollower, Detection, Emit, EventKind, LinkError, Stage, StageError, TwinState,
    flags,
};

use crate::cell::CellFacts;
use tauscope_watch as watch;

/// A detect or explain stage whose events are reported to the supervisor; its output stream is unchanged.
pub struct Announced<S> {
    stage: S,
    told: Told,
}

/// State of the reports of one stage.
struct Told {
    /// Name of the stage.
    stage: String,
    joint_names: Vec<String>,
    effort_unit: &'static str,
    /// Stamp of the first sample, the origin of reported times \[ns\].
    start_ns: Option<i64>,
    contacts: ContactFollower,
}

impl<S> Announced<S> {
    /// Wraps `stage`, which is called `name` in `cell`.
    pub fn new(name: &str, stage: S, cell: &CellFacts) -> Self {
        let told = Told {
            stage: name.to_owned(),
            joint_names: cell.joint_names.clone(),
            effort_unit: cell.effort_unit.as_str(),
            start_ns: None,
            contacts: ContactFollower::default(),
        };
        Self { stage, told }
    }
}

impl<S: Stage<TwinState, Detection>> Stage<TwinState, Detection> for Announced<S> {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        self.stage.accept(
            sample,
            &mut Listener {
                out,
                told: &mut self.told,
            },
        )
    }

    fn finish(&mut self, out: &mut dyn Emit<Detection>) -> Result<(), StageError> {
        self.stage.finish(out)
    }

    fn dropped(&self) -> u64 {
        self.stage.dropped()
    }
}

struct Listener<'a> {
    out: &'a mut dyn Emit<Detection>,
    told: &'a mut Told,
}

impl Emit<Detection> for Listener<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let told = &mut *self.told;
        self.out.emit(&mut |slot| {
            write(slot);
            for line in told.lines(slot) {
                shell::note(&told.stage, &line);
            }
            match slot.event() {
                EventKind::Onset => shell::holds(&told.stage, slot.state.as_str()),
                EventKind::Offset => shell::holds(&told.stage, ""),
                EventKind::None => {}
            }
        })
    }
}

/// Describes the onset of a contact, with its link if known.
fn first_guess(detection: &Detection) -> String {
    if detection.link.as_str().is_empty() {
        return detection.state.to_string();
    }
    format!("{} at {} (first guess)", detection.state, detection.links())
}

impl Told {
    /// Returns the lines to report for a sample: the event that ends, then the event that begins.
    fn lines(&mut self, detection: &Detection) -> Vec<String> {
        let start_ns = *self.start_ns.get_or_insert(detection.header.stamp_ns);
        let t = (detection.header.stamp_ns - start_ns) as f64 * 1e-9;
        let ended = self.contacts.push(detection);
        let watches = detection.detector.as_str() == watch::NAME;
        let over = |ended: Contact| format!("{t:8.3} s  {}", self.over(&ended));
        match detection.event() {
            EventKind::None => Vec::new(),
            EventKind::Onset if watches => vec![self.change(t, start_ns, detection)],
            EventKind::Offset if watches => (ended.and_then(|ended| ended.size).into_iter())
                .map(|_| format!("{t:8.3} s  learned: the arm as it is now is the new reference"))
                .collect(),
            EventKind::Offset => ended.map(over).into_iter().collect(),
            EventKind::Onset => {
                let begun = format!("{t:8.3} s  {}", first_guess(detection));
                ended.map(over).into_iter().chain([begun]).collect()
            }
        }
    }

    /// Describes a change of the arm that the watch has detected.
    fn change(&self, t: f64, start_ns: i64, detection: &Detection) -> String {
        let since = (detection.contact_ns - start_ns) as f64 * 1e-9;
        let words = watch::in_words(detection, &self.joint_names, self.effort_unit);
        let over = if detection.header.has(flags::CHANGE) {
            ""
        } else {
            ", over again"
        };
        format!("{t:8.3} s  since {since:.1} s: {words}{over}")
    }

    /// Describes a contact that has ended: duration, peak and loaded joints.
    fn over(&self, contact: &Contact) -> String {
        let mut text = format!("over after {}", contact.duration_in_words());
        if contact.peak().is_some() {
            text += &format!("; at its strongest {contact}");
        }
        let loaded = self.joint_names.iter().enumerate();
        let loaded: Vec<&str> = loaded
            .filter(|(j, _)| *j < 32 && contact.joints & (1 << j) != 0)
            .map(|(_, name)| name.as_str())
            .collect();
        if !loaded.is_empty() {
            text += &format!(", felt in {}", loaded.join(", "));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tauscope_bus::Name;

    fn told() -> Told {
        Told {
            stage: "detect".to_owned(),
            joint_names: Vec::new(),
            effort_unit: "Nm",
            start_ns: None,
            contacts: ContactFollower::default(),
        }
    }

    fn onset(s: i64, state: &str, link: &str) -> Detection {
        let mut detection = Detection::default();
        detection.header.stamp_ns = s * 1_000_000_000;
        detection.header.flags = flags::ALARM;
        detection.state = Name::new(state);
        detection.link = Name::new(link);
        detection.event = Detection::ONSET;
        detection.contact_ns = detection.header.stamp_ns;
        detection
    }

    #[test]
    fn an_onset_tells_the_first_guess_as_one_and_each_line_stands_alone() {
        let mut told = told();
        told.lines(&Detection::default());
        let lines = told.lines(&onset(1, "contact", "link4"));
        assert_eq!(lines, ["   1.000 s  contact at link4 (first guess)"]);
        let lines = told.lines(&onset(3, "collision", ""));
        assert_eq!(lines.len(), 2, "{lines:?}");
        assert!(lines[0].starts_with("   3.000 s  over after"));
        assert_eq!(lines[1], "   3.000 s  collision");
    }
}
