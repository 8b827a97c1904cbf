//! Tells the supervisor, and so people, what a detector or a watch finds, as it finds it.

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
            if let Some(line) = told.line(slot) {
                shell::note(&told.stage, &line);
            }
        })
    }
}

impl Told {
    /// What is to be said of a sample, if anything begins or ends there.
    fn line(&mut self, detection: &Detection) -> Option<String> {
        let start_ns = *self.start_ns.get_or_insert(detection.header.stamp_ns);
        let t = (detection.header.stamp_ns - start_ns) as f64 * 1e-9;
        let ended = self.contacts.push(detection);
        let watches = detection.detector.as_str() == watch::NAME;
        match detection.event() {
            EventKind::Onset if watches => Some(self.change(t, start_ns, detection)),
            EventKind::Offset if watches => ended?
                .size
                .map(|_| format!("{t:8.3} s  learned: the arm as it is now is the rule")),
            EventKind::None => None,
            EventKind::Onset => {
                let begun = format!("{t:8.3} s  {}", detection.state);
                Some(match ended {
                    Some(before) => format!("{t:8.3} s  {}\n{begun}", self.over(&before)),
                    None => begun,
                })
            }
            EventKind::Offset => Some(format!("{t:8.3} s  {}", self.over(&ended?))),
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
        let mut text = format!("over after {:.2} s", contact.duration_s());
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
