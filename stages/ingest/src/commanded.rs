//! Commands in the stream of samples: a source that wraps another, attaches the next command to each sample, and
//! applies its effect from that sample on.
//!
//! Live commands come from an inbox (Zenoh), those of an archive come with its samples. Both have the same effect, so
//! a replay reproduces the run.

mod inbox;

use std::task::Waker;
use std::time::Duration;

use tauscope_bus::command::Answer;
use tauscope_bus::{
    Command, Emit, JointState, LinkError, Progress, Source, StageError, Trouble, Verb,
    ZenohEndpoints, flags,
};

use crate::setup::{Setup, Tool};
use inbox::Inbox;

/// Limits of the commands that a cell accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Takes {
    /// Whether a detector of the cell learns while it runs.
    pub learn: bool,
    /// Mass of the arm \[kg\], if known; a heavier payload is refused.
    pub arm_kg: Option<f64>,
}

/// A source that adds commands to the samples of another source.
pub struct Commanded {
    inner: Box<dyn Source<JointState>>,
    effects: Effects,
    inbox: Option<Inbox>,
}

impl Commanded {
    /// Wraps `inner`, whose samples already carry the commands of an archive.
    pub fn archived(inner: Box<dyn Source<JointState>>) -> Self {
        Self {
            inner,
            effects: Effects::default(),
            inbox: None,
        }
    }

    /// Wraps `inner` and accepts commands for its cell at `endpoints`, within the limits of `takes`.
    ///
    /// # Errors
    /// If Zenoh rejects an endpoint, or cannot listen there.
    pub fn live(
        inner: Box<dyn Source<JointState>>,
        setup: &Setup,
        endpoints: &ZenohEndpoints,
        takes: Takes,
    ) -> Result<Self, LinkError> {
        Ok(Self {
            inbox: Some(Inbox::open(endpoints, setup, takes)?),
            ..Self::archived(inner)
        })
    }
}

/// Effects of the commands so far on all later samples. Pure.
#[derive(Debug, Default)]
struct Effects {
    told: Option<Told>,
}

/// A tool set by a payload command.
#[derive(Debug, Clone, Copy)]
struct Told {
    /// The tool; mass 0 for none.
    tool: Tool,
    /// Tool that the source itself reported then. Once it reports neither this nor `tool`, the command is obsolete.
    instead_of: Tool,
}

impl Effects {
    fn apply(&mut self, sample: &mut JointState) {
        let Command { value, com_m, .. } = sample.command;
        let own = tool_of(sample);
        self.told = self
            .told
            .filter(|told| told.instead_of == own || told.tool == own);
        match sample.command.verb() {
            Some(Verb::Payload) => {
                let tool = Tool {
                    mass_kg: value,
                    com_m,
                    inertia_kgm2: [0.0; 6],
                };
                self.told = Some(Told {
                    tool,
                    instead_of: own,
                });
            }
            Some(Verb::Learn) => sample.header.flags |= flags::LEARN,
            Some(Verb::Acknowledge | Verb::Mute | Verb::Label) | None => {}
        }
        let Some(Told { tool, .. }) = self.told else {
            return;
        };
        sample.header.flags &= !flags::TOOL;
        let tool = if tool.mass_kg > 0.0 {
            sample.header.flags |= flags::TOOL;
            tool
        } else {
            Tool::default()
        };
        sample.tool_mass_kg = tool.mass_kg;
        sample.tool_com_m = tool.com_m;
        sample.tool_inertia_kgm2 = tool.inertia_kgm2;
    }
}

/// Returns the tool reported in a sample; all zeros for none.
fn tool_of(sample: &JointState) -> Tool {
    if !sample.header.has(flags::TOOL) {
        return Tool::default();
    }
    Tool {
        mass_kg: sample.tool_mass_kg,
        com_m: sample.tool_com_m,
        inertia_kgm2: sample.tool_inertia_kgm2,
    }
}

struct EmitCommanded<'a> {
    out: &'a mut dyn Emit<JointState>,
    effects: &'a mut Effects,
    inbox: Option<&'a mut Inbox>,
}

impl Emit<JointState> for EmitCommanded<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let (effects, inbox) = (&mut *self.effects, &mut self.inbox);
        let mut taken = None;
        self.out.emit(&mut |sample| {
            write(sample);
            // A sample has room for one command; the next one waits for the next sample.
            if sample.command.verb().is_none()
                && let Some(waiting) = inbox.as_mut().and_then(|inbox| inbox.pop())
            {
                sample.command = waiting.command;
                taken = Some((waiting, sample.header.stamp_ns));
            }
            effects.apply(sample);
        })?;
        if let (Some((waiting, stamp_ns)), Some(inbox)) = (taken, inbox) {
            inbox.answer(waiting, Answer::Taken { stamp_ns });
        }
        Ok(())
    }
}

impl Source<JointState> for Commanded {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let progress = self.inner.step(&mut EmitCommanded {
            out,
            effects: &mut self.effects,
            inbox: self.inbox.as_mut(),
        })?;
        if let Some(inbox) = &mut self.inbox {
            inbox.refuse_what_waits_too_long();
        }
        Ok(progress)
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

#[cfg(test)]
mod tests {
    use tauscope_bus::command::Request;

    use super::*;

    fn sample(request: Option<Request>) -> JointState {
        let mut sample = JointState {
            command: request.map_or_else(Command::default, |r| r.command().unwrap()),
            tool_mass_kg: 9.0,
            ..JointState::default()
        };
        sample.header.flags = flags::TOOL;
        sample
    }

    #[test]
    fn a_payload_stays_until_another_is_told() {
        let mut effects = Effects::default();
        let mut after = |request| {
            let mut sample = sample(request);
            effects.apply(&mut sample);
            (sample.header.has(flags::TOOL), sample.tool_mass_kg)
        };
        assert_eq!(after(None), (true, 9.0), "what the cell says itself");
        let told = |mass_kg| {
            Some(Request::Payload {
                mass_kg,
                com_m: [0.0, 0.0, 0.1],
            })
        };
        assert_eq!(after(told(2.5)), (true, 2.5));
        assert_eq!(after(None), (true, 2.5));
        assert_eq!(after(told(0.0)), (false, 0.0));
        assert_eq!(after(None), (false, 0.0));
    }

    #[test]
    fn a_payload_gives_way_to_a_tool_that_the_robot_tells_of_later() {
        let mut effects = Effects::default();
        let mut told = sample(Some(Request::Payload {
            mass_kg: 2.5,
            com_m: [0.0; 3],
        }));
        effects.apply(&mut told);
        let mut other = sample(None);
        other.tool_mass_kg = 4.0;
        effects.apply(&mut other);
        assert_eq!(other.tool_mass_kg.to_bits(), 4.0_f64.to_bits());
        let mut again = sample(None);
        effects.apply(&mut again);
        assert_eq!(
            again.tool_mass_kg.to_bits(),
            9.0_f64.to_bits(),
            "the command is over"
        );
    }

    #[test]
    fn learning_is_asked_for_once() {
        let mut effects = Effects::default();
        for (request, asked) in [(Some(Request::Learn), true), (None, false)] {
            let mut sample = sample(request);
            effects.apply(&mut sample);
            assert_eq!(sample.header.has(flags::LEARN), asked);
        }
    }
}
