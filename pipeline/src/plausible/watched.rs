//! Source and twin wrappers of a run that warn once about each implausibility in their samples.

use std::collections::BTreeSet;
use std::task::Waker;
use std::time::Duration;

use tauscope_bus::{
    Emit, JointState, LinkError, Progress, Source, Stage, StageError, Trouble, TwinState,
};

use tauscope_session::{Finding, Plausible};

use super::PlausibleTwin;

/// Time of the first check \[ns of stream time\]; the interval doubles for each further check.
/// Physical: a person who watches the start is still present after three seconds.
const FIRST_LOOK_NS: i64 = 3_000_000_000;
/// Longest interval between checks \[ns\].
/// Resolution: a check costs microseconds.
const LONGEST_NS: i64 = 60_000_000_000;

/// Schedule of the checks, and the warnings already issued.
#[derive(Debug, Default)]
struct Told {
    next_ns: Option<i64>,
    wait_ns: i64,
    said: BTreeSet<String>,
}

impl Told {
    /// Whether a check is due.
    fn is_time(&mut self, stamp_ns: i64) -> bool {
        let next_ns = *self.next_ns.get_or_insert(stamp_ns + FIRST_LOOK_NS);
        // A clock that was set back must not suspend the checks.
        if (next_ns - LONGEST_NS..next_ns).contains(&stamp_ns) {
            return false;
        }
        self.wait_ns = (2 * self.wait_ns).clamp(FIRST_LOOK_NS, LONGEST_NS);
        self.next_ns = Some(stamp_ns + self.wait_ns);
        true
    }

    fn warn(&mut self, stage: &str, key: String, text: &str) {
        if self.said.insert(key) {
            tracing::warn!("{stage}: {text}");
        }
    }
}

/// A source that warns about irregularities of its joint states.
pub struct Watched<S> {
    stage: String,
    inner: S,
    plausible: Plausible,
    told: Told,
}

impl<S> Watched<S> {
    /// Watches `inner`, the source of the stage with this name.
    pub fn new(stage: &str, inner: S, plausible: Plausible) -> Self {
        Self {
            stage: stage.to_owned(),
            inner,
            plausible,
            told: Told::default(),
        }
    }
}

/// Forwards samples and passes each one to `see`.
struct Seen<'a, T> {
    out: &'a mut dyn Emit<T>,
    see: &'a mut dyn FnMut(&T),
}

impl<T: tauscope_bus::Sample> Emit<T> for Seen<'_, T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let see = &mut *self.see;
        self.out.emit(&mut |sample| {
            write(sample);
            see(sample);
        })
    }
}

impl<S: Source<JointState>> Source<JointState> for Watched<S> {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let (stage, plausible, told) = (&self.stage, &mut self.plausible, &mut self.told);
        let see = &mut |sample: &JointState| {
            plausible.add(sample);
            if told.is_time(sample.header.stamp_ns) {
                let findings = plausible.findings().into_iter();
                // Pauses are reported elsewhere, when they are noticed.
                for finding in findings.filter(|it| !matches!(it, Finding::Pause { .. })) {
                    told.warn(stage, finding.subject(), &finding.to_string());
                }
            }
        };
        self.inner.step(&mut Seen { out, see })
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.inner.register(waker)
    }

    fn dropped(&self) -> u64 {
        self.inner.dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        self.inner.fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        self.inner.trouble(silent_for)
    }
}

/// A twin that warns about irregularities of measured and expected effort.
pub struct WatchedTwin<S> {
    stage: String,
    inner: S,
    plausible: PlausibleTwin,
    told: Told,
}

impl<S> WatchedTwin<S> {
    /// Watches `inner`, the twin of the stage with this name.
    pub fn new(stage: &str, inner: S, plausible: PlausibleTwin) -> Self {
        Self {
            stage: stage.to_owned(),
            inner,
            plausible,
            told: Told::default(),
        }
    }

    fn seen<R>(
        &mut self,
        out: &mut dyn Emit<TwinState>,
        run: impl FnOnce(&mut S, &mut dyn Emit<TwinState>) -> R,
    ) -> R {
        let (stage, plausible, told) = (&self.stage, &mut self.plausible, &mut self.told);
        let see = &mut |sample: &TwinState| {
            let have_ceased = plausible.add(sample);
            if told.is_time(sample.header.stamp_ns) || have_ceased {
                for text in plausible.oddities() {
                    // The text without its numbers, which change from check to check.
                    let key = text.replace(|c: char| c.is_ascii_digit() || c == '.', "");
                    told.warn(stage, key, &text);
                }
            }
        };
        run(&mut self.inner, &mut Seen { out, see })
    }
}

impl<S: Stage<JointState, TwinState>> Stage<JointState, TwinState> for WatchedTwin<S> {
    fn accept(
        &mut self,
        sample: &JointState,
        out: &mut dyn Emit<TwinState>,
    ) -> Result<(), StageError> {
        self.seen(out, |inner, out| inner.accept(sample, out))
    }

    fn finish(&mut self, out: &mut dyn Emit<TwinState>) -> Result<(), StageError> {
        self.seen(out, Stage::finish)
    }

    fn dropped(&self) -> u64 {
        self.inner.dropped()
    }
}
