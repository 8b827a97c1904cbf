//! Tells the supervisor, and so people, what a detector or a watch finds, as it finds it.

mod clock;
pub mod commands;

use tauscope_bus::shell;
use tauscope_bus::{
    Contact, ContactFollower, Detection, Emit, EventKind, LinkError, Stage, StageError, TwinState,
    flags,
};

use tauscope_pipeline::cell::CellFacts;
use tauscope_watch as watch;

/// A detect or explain stage whose events are told to the supervisor. Its stream is untouched.
pub struct Announced<S> {
    stage: S,
    told: Told,
}

/// What has been told so far.
struct Told {
    /// Who finds it.
    stage: String,
    joint_names: Vec<String>,
    effort_unit: &'static str,
    /// Stamp of the first sample, from which times are counted \[ns\].
    start_ns: Option<i64>,
    contacts: ContactFollower,
}

impl<S> Announced<S> {
    /// `stage` of that name in a cell.
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

/// A contact that begins, and where it seems to be.
fn first_guess(detection: &Detection) -> String {
    if detection.link.as_str().is_empty() {
        return detection.state.to_string();
    }
    format!("{} at {} (first guess)", detection.state, detection.links())
}

impl Told {
    /// What is to be said of a sample: what ends there, then what begins.
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

    /// What a watch noticed, which is told once it is sure.
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

    /// What is known of a contact that is over.
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
