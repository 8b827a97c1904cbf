//! Says on the terminal what a detector finds, as it finds it.

use tauscope_bus::{Detection, Emit, EventKind, LinkError, Stage, StageError, TwinState, flags};

/// A detect stage whose events are told on standard error. Its stream is untouched.
pub struct Announced<S> {
    stage: S,
    told: Told,
}

/// What has been told so far.
struct Told {
    joint_names: Vec<String>,
    /// Stamp of the first sample, from which times are counted \[ns\].
    start_ns: Option<i64>,
    /// The sample of this event with the largest score.
    strongest: Option<Detection>,
}

impl<S> Announced<S> {
    /// `stage` in a cell with these joints.
    pub fn new(stage: S, joint_names: &[String]) -> Self {
        let told = Told {
            joint_names: joint_names.to_vec(),
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
                eprintln!("{line}");
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
        match detection.event() {
            EventKind::None => None,
            EventKind::Onset => Some(format!("{t:8.3} s  {}", detection.state)),
            EventKind::Offset => {
                let strongest = self.strongest.take()?;
                Some(format!("{t:8.3} s  over{}", self.strength(&strongest)))
            }
        }
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
