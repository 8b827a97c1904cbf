//! Evaluation of the joints' currents, common to both versions of the sensor and computed once where they share it.

use tauscope_bus::{MAX_JOINTS, TwinState, flags};

use super::joint::{Block, BlockSettings, Currents};

/// The joints' blocks. No allocation per sample.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    joints: Vec<Block>,
    newest_ns: Option<i64>,
    newest: Step,
}

/// Result of a sample.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Step {
    /// Time since the previous sample; 0 at the first \[s\].
    pub dt_s: f64,
    /// Whether the blocks were reset at this sample.
    pub anew: bool,
    /// State of the currents, by joint.
    pub currents: [Currents; MAX_JOINTS],
}

impl Blocks {
    pub(super) fn new(settings: BlockSettings, joints: usize) -> Self {
        Self {
            joints: vec![Block::new(settings); joints],
            newest_ns: None,
            newest: Step::default(),
        }
    }

    /// Processes the next sample. A repeated stamp changes nothing.
    pub(super) fn update(&mut self, sample: &TwinState) -> &Step {
        let stamp_ns = sample.header.stamp_ns;
        let before_ns = self.newest_ns.replace(stamp_ns);
        if before_ns == Some(stamp_ns) {
            return &self.newest;
        }
        let dt_s = before_ns.map(|before_ns| (stamp_ns - before_ns) as f64 * 1e-9);
        let goes_on = dt_s.filter(|dt_s| *dt_s >= 0.0 && !sample.header.has(flags::RESET));
        self.newest.anew = goes_on.is_none();
        self.newest.dt_s = goes_on.unwrap_or(0.0);
        for (j, block) in self.joints.iter_mut().enumerate() {
            let (measured, expected) = (sample.effort[j], sample.expected_effort[j]);
            if self.newest.anew {
                block.reset(measured, expected);
            }
            self.newest.currents[j] = block.update(self.newest.dt_s, measured, expected);
        }
        &self.newest
    }
}
