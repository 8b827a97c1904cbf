//! Says on the terminal what a detector finds, as it finds it.

use tauscope_bus::{Detection, Emit, EventKind, LinkError, Stage, StageError, TwinState, flags};

/// A detect stage whose events are told on standard error. Its stream is untouched.
pub struct Announced<S> {
    stage: S,
    joint_names: Vec<String>,
    /// Stamp of the first sample, from which times are counted \[ns\].
    start_ns: Option<i64>,
}

impl<S> Announced<S> {
    /// `stage` in a cell with these joints.
    pub fn new(stage: S, joint_names: &[String]) -> Self {
        Self {
            stage,
            joint_names: joint_names.to_vec(),
            start_ns: None,
        }
    }
}

impl<S: Stage<TwinState, Detection>> Stage<TwinState, Detection> for Announced<S> {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let start_ns = *self.start_ns.get_or_insert(sample.header.stamp_ns);
        let joint_names = &self.joint_names;
        self.stage.accept(
            sample,
            &mut Listener {
                out,
                joint_names,
                start_ns,
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
    joint_names: &'a [String],
    start_ns: i64,
}

impl Emit<Detection> for Listener<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let (joint_names, start_ns) = (self.joint_names, self.start_ns);
        self.out.emit(&mut |slot| {
            write(slot);
            if let Some(line) = line(slot, joint_names, start_ns) {
                eprintln!("{line}");
            }
        })
    }
}

/// What is to be said of a sample, if anything begins or ends there.
fn line(detection: &Detection, joint_names: &[String], start_ns: i64) -> Option<String> {
    let t = (detection.header.stamp_ns - start_ns) as f64 * 1e-9;
    match detection.event() {
        EventKind::None => None,
        EventKind::Offset => Some(format!("{t:8.3} s  over")),
        EventKind::Onset => {
            let mut line = format!("{t:8.3} s  {}", detection.state);
            if detection.header.has(flags::FORCE) {
                let newtons = detection.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
                line += &format!(" at {}, {newtons:.0} N", detection.link);
            }
            let loaded = joint_names.iter().enumerate();
            let loaded: Vec<&str> = loaded
                .filter(|(j, _)| detection.joints & (1 << j) != 0)
                .map(|(_, name)| name.as_str())
                .collect();
            if !loaded.is_empty() {
                line += &format!(" ({})", loaded.join(", "));
            }
            Some(line)
        }
    }
}
