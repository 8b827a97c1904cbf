#![doc = include_str!("../README.md")]

mod blocks;
mod config;
mod finding;
mod judge;
mod memory;
mod messages;
mod moments;
mod monitor;
mod rows;
mod scale;
#[cfg(test)]
mod tests;
mod touch;
mod usual;
mod window;

use tauscope_bus::{Detection, Emit, Name, Stage, StageError, TwinState, flags};
use tauscope_dynamics::Model;

pub use config::Config;
pub use finding::{Cause, Finding};
pub use memory::Memory;
pub use messages::{amount, in_words, size_unit};

use monitor::{Monitor, News};
use rows::Rows;

/// The stage's name in archives, in the place of a detector's name.
pub const NAME: &str = "residual_watch";

/// Facts about the cell and its twin.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The robot model. Without it neither payloads nor links are reported.
    pub model: Option<Model>,
    /// Measured effort per torque at the joint, by joint in URDF order \[effort unit per N m\]. NaN where it is not
    /// known: such a joint is not used for payloads and forces.
    pub effort_per_nm: Vec<f64>,
    /// Cutoff of the twin's low-pass on efforts, by joint in URDF order \[Hz\].
    pub effort_cutoff_hz: Vec<f64>,
}

/// The stage: takes twin states and emits one detection for each.
#[derive(Debug)]
pub struct Watch {
    name: Name,
    rows: Rows,
    monitor: Monitor,
    /// Name of the tool's link, and names of the joints' child links.
    tool: Name,
    links: Vec<Name>,
    /// The change that was reported and is being learned.
    changed: Option<Finding>,
    /// Whether a contact was reported with the previous sample.
    ends: bool,
}

impl Watch {
    /// Creates a watch over the residual of a twin.
    pub fn new(config: &Config, setup: &Setup) -> Self {
        let model = setup.model.as_ref();
        let name = |model: &Model, link: usize| Name::new(&model.links()[link].name);
        let links = model.map_or_else(Vec::new, |model| {
            let bodies = (0..model.dof()).map(|joint| model.body_link(joint));
            bodies.map(|link| name(model, link)).collect()
        });
        Self {
            name: Name::new(NAME),
            rows: Rows::new(setup),
            monitor: Monitor::new(setup.effort_per_nm.len(), config.learn_s, config.caution),
            tool: model.map_or_else(Name::default, |model| name(model, model.tool_link())),
            links,
            changed: None,
            ends: false,
        }
    }

    /// Restores the state learnt by an earlier run, if it [fits](Memory::fits) the robot.
    #[must_use]
    pub fn resumed(mut self, memory: &Memory) -> Self {
        self.monitor.resume(memory);
        self
    }

    /// Returns the learnt state for [`Watch::resumed`]; `None` before the first reference is learnt.
    pub fn learnt(&self) -> Option<Memory> {
        self.monitor.watches().then(|| self.monitor.memory())
    }

    /// Returns whether the stage is learning a reference.
    pub fn is_learning(&self) -> bool {
        !self.monitor.watches()
    }

    /// Returns the name of a finding's link; empty if it has none.
    fn link(&self, finding: &Finding) -> Name {
        match finding.cause {
            Cause::Payload => self.tool,
            _ => (finding.link.and_then(|link| self.links.get(link)))
                .copied()
                .unwrap_or_default(),
        }
    }
}

impl Stage<TwinState, Detection> for Watch {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let news = self
            .rows
            .take(sample)
            .and_then(|row| self.monitor.take(row));
        let mut event = 0;
        let mut told = self.changed;
        if self.ends {
            self.ends = false;
            event = Detection::OFFSET;
        }
        match news {
            Some(News::Found(finding)) => {
                event = Detection::ONSET;
                told = Some(finding);
                if finding.cause == Cause::Contact {
                    self.ends = true;
                } else {
                    self.changed = told;
                }
            }
            Some(News::Learned) => {
                event = Detection::OFFSET;
                told = None;
                self.changed = None;
            }
            None => {}
        }
        let watches = self.monitor.watches();
        out.emit(&mut |slot| {
            slot.header = sample.header;
            slot.header.flags = sample.header.flags & flags::RESET;
            if watches {
                slot.header.flags |= flags::READY;
            }
            slot.detector = self.name;
            slot.event = event;
            slot.score = self.monitor.score();
            slot.threshold = 1.0;
            slot.state = Name::new(match &told {
                Some(finding) => finding.cause.name(),
                None if watches => "free",
                None => "not_ready",
            });
            if let Some(finding) = &told {
                slot.header.flags |= flags::ALARM;
                finding.tell(slot);
                slot.link = self.link(finding);
                if finding.cause != Cause::Contact {
                    slot.header.flags |= flags::CHANGE;
                }
            }
        })?;
        Ok(())
    }
}
