//! Reports to the supervisor which commands the source of a cell accepts, when a mute ends, and when its clock jumps.

use std::task::Waker;
use std::time::Duration;

use super::clock::Clock;
use tauscope_bus::command::MuteLease;
use tauscope_bus::{Emit, JointState, LinkError, Progress, Source, StageError, Trouble, shell};

/// Condition that a source reports while its cell is muted.
pub const MUTED: &str = "muted";

/// A source whose accepted commands are reported to the supervisor; its output stream is unchanged.
pub struct Announced<S> {
    source: S,
    told: Told,
}

/// State of the reports of one source.
#[derive(Debug, Default)]
struct Told {
    /// Name of the source.
    stage: String,
    /// Stamp of the first sample, the origin of reported times \[ns\].
    start_ns: Option<i64>,
    /// The mute that is in effect, if any.
    mute: Option<MuteLease>,
    clock: Clock,
}

impl<S> Announced<S> {
    /// Wraps `source`, which is called `name`.
    pub fn new(name: &str, source: S) -> Self {
        let told = Told {
            stage: name.to_owned(),
            ..Told::default()
        };
        Self { source, told }
    }
}

impl<S: Source<JointState>> Source<JointState> for Announced<S> {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        self.source.step(&mut Listener {
            out,
            told: &mut self.told,
        })
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.source.register(waker)
    }

    fn dropped(&self) -> u64 {
        self.source.dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        self.source.fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        self.source.trouble(silent_for)
    }
}

struct Listener<'a> {
    out: &'a mut dyn Emit<JointState>,
    told: &'a mut Told,
}

impl Emit<JointState> for Listener<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let told = &mut *self.told;
        self.out.emit(&mut |slot| {
            write(slot);
            let was_muted = told.is_muted();
            for line in told.lines(slot) {
                shell::note(&told.stage, &line);
            }
            if told.is_muted() != was_muted {
                shell::holds(&told.stage, if was_muted { "" } else { MUTED });
            }
        })
    }
}

impl Told {
    fn is_muted(&self) -> bool {
        self.mute.is_some()
    }

    /// Returns the lines to report for a sample.
    fn lines(&mut self, state: &JointState) -> impl Iterator<Item = String> + use<> {
        let now_ns = state.header.stamp_ns;
        let start_ns = *self.start_ns.get_or_insert(now_ns);
        let t = (now_ns - start_ns) as f64 * 1e-9;
        let over = self.mute.take_if(|mute| !mute.holds(now_ns)).is_some();
        let command = &state.command;
        if let Some(mute) = MuteLease::of(now_ns, command) {
            self.mute = mute.holds(now_ns).then_some(mute);
        }
        let jump = self.clock.line(state);
        let jump = jump.map(|words| format!("{t:8.3} s  {words}"));
        let over = over.then(|| format!("{t:8.3} s  the mute is over"));
        let taken = command.in_words();
        let taken = taken.map(|words| format!("{t:8.3} s  {words}"));
        jump.into_iter().chain(over).chain(taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tauscope_bus::{Command, Verb};

    #[test]
    fn a_mute_is_told_when_it_begins_and_when_it_ends() {
        let mut told = Told::default();
        let mut said = Vec::new();
        for n in 0..5_i64 {
            let mut state = JointState::default();
            state.header.stamp_ns = 1_000_000_000 * n;
            state.header.received_ns = state.header.stamp_ns;
            if n == 1 {
                state.command = Command {
                    verb: Verb::Mute as u32,
                    value: 2.0,
                    ..Command::default()
                };
            }
            said.extend(told.lines(&state));
        }
        let expected = [
            "   1.000 s  alarms muted for 2 s",
            "   3.000 s  the mute is over",
        ];
        assert_eq!(said, expected);
    }
}
