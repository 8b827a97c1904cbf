//! Tells the supervisor, and so people, what a detector or a watch finds, as it finds it.

use tauscope_bus::shell;
use tauscope_bus::{Detection, Emit, EventKind, LinkError, Stage, StageError, TwinState, flags};

use tauscope_pipeline::cell::CellFacts;
use tauscope_watch as watch;

/// A detect or explain stage whose events are told to the supervisor. Its stream is untouched.
pub struct Announced<S> {
    stage: S,
    told: Told,
}

/// What has been told so far.
struct Told {
    joint_names: Vec<String>,
    effort_unit: &'static str,
    /// Stamp of the first sample, from which times are counted \[ns\].
    start_ns: Option<i64>,
    /// The sample of this event with the largest score.
    strongest: Option<Detection>,
}

impl<S> Announced<S> {
    /// `stage` in a cell.
    pub fn new(stage: S, cell: &CellFacts) -> Self {
        let told = Told {
            joint_names: cell.joint_names.clone(),
            effort_unit: cell.effort_unit.as_str(),
            start_ns: None,
            strongest: None,
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
                shell::note(&line);
            }
        })
    }
}

impl Told {
    /// What is to be said of a sample, if anything begins or ends there.
    fn line(&mut self, detection: &Detection) -> Option<String> {
        let start_ns = *self.start_ns.get_or_insert(detection.header.stamp_ns);
        let t = (detection.header.stamp_ns - start_ns) as f64 * 1e-9;
        let is_stronger = |before: &Detection| detection.score > before.score;
        if detection.alarm() && self.strongest.as_ref().is_none_or(is_stronger) {
            self.strongest = Some(*detection);
        }
        let watches = detection.detector.as_str() == watch::NAME;
        match detection.event() {
            EventKind::Onset if watches => Some(self.change(t, start_ns, detection)),
            EventKind::Offset if watches => {
                let told = self.strongest.take()?;
                let learned = format!("{t:8.3} s  learned: the arm as it is now is the rule");
                told.header.has(flags::CHANGE).then_some(learned)
            }
            EventKind::None => None,
            EventKind::Onset => Some(format!("{t:8.3} s  {}", detection.state)),
            EventKind::Offset => {
                let strongest = self.strongest.take()?;
                Some(format!("{t:8.3} s  over{}", self.strength(&strongest)))
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

    /// Where and how hard, as far as it is known.
    fn strength(&self, strongest: &Detection) -> String {
        let mut text = String::new();
        if strongest.header.has(flags::FORCE) {
            let newtons = strongest.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
            text += &format!("; at its strongest {newtons:.0} N at {}", strongest.link);
        }
        let loaded = self.joint_names.iter().enumerate();
        let loaded: Vec<&str> = loaded
            .filter(|(j, _)| strongest.joints & (1 << j) != 0)
            .map(|(_, name)| name.as_str())
            .collect();
        if !loaded.is_empty() {
            text += &format!(", felt in {}", loaded.join(", "));
        }
        text
    }
}
