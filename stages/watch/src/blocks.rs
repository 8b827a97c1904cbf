//! Blocks of half a second of motion, and a ring of the newest ones.

use super::moments::{Moments, Outer};
use super::rows::{FORCE, PAYLOAD, ROW_NS, Row};

/// Rows in a block: half a second at 20 rows a second.
/// Chosen: half a second locates an onset well enough; fewer rows hardly average the noise, more hide a short
/// contact.
pub(super) const BLOCK_ROWS: u32 = 10;
/// Duration of motion in a block \[s\].
/// Derived: [`BLOCK_ROWS`] rows of [`ROW_NS`].
pub(super) const BLOCK_S: f64 = BLOCK_ROWS as f64 * ROW_NS as f64 * 1e-9;
/// Features in which a motion may be novel.
/// Physical: position, velocity and expected effort.
pub(crate) const FEATURES: usize = 3;

/// The range of a joint's features.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranges {
    pub low: [f64; FEATURES],
    pub high: [f64; FEATURES],
}

impl Ranges {
    pub const NONE: Self = Self {
        low: [f64::INFINITY; FEATURES],
        high: [f64::NEG_INFINITY; FEATURES],
    };

    fn take(&mut self, features: [f64; FEATURES]) {
        for (f, value) in features.into_iter().enumerate() {
            self.low[f] = self.low[f].min(value);
            self.high[f] = self.high[f].max(value);
        }
    }

    fn join(&mut self, other: &Self) {
        self.take(other.low);
        self.take(other.high);
    }

    /// Returns whether `other` exceeds this range in any feature by more than the share `slack` of it.
    fn is_left_by(&self, other: &Self, slack: f64) -> bool {
        (0..FEATURES).any(|f| {
            let slack = slack * (self.high[f] - self.low[f]);
            other.low[f] < self.low[f] - slack || other.high[f] > self.high[f] + slack
        })
    }
}

/// Range of each feature as \[lowest, highest\]; `None` if it has no value.
pub(crate) type Told = [Option<[f64; 2]>; FEATURES];

/// The ranges of a joint's recent motion. Old motion is forgotten, as in the reference: a program that returns after
/// many others is novel again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Ranges of the current generation of blocks, and of the previous one.
    current: Ranges,
    previous: Ranges,
    blocks: usize,
}

impl Known {
    pub const NONE: Self = Self {
        current: Ranges::NONE,
        previous: Ranges::NONE,
        blocks: 0,
    };
    /// Blocks in a generation: 150 s of motion.
    /// Derived: the time constant of the reference, `MEMORY_S`, over [`BLOCK_S`].
    const GENERATION: usize = 300;

    pub fn take(&mut self, ranges: &Ranges) {
        if self.blocks == Self::GENERATION {
            self.previous = self.current;
            self.current = Ranges::NONE;
            self.blocks = 0;
        }
        self.current.join(ranges);
        self.blocks += 1;
    }

    /// Returns the ranges of both generations, and the number of blocks in the current one.
    pub fn told(&self) -> ([Told; 2], usize) {
        let told = |ranges: &Ranges| {
            std::array::from_fn(|f| {
                let range = [ranges.low[f], ranges.high[f]];
                range.iter().all(|x| x.is_finite()).then_some(range)
            })
        };
        ([told(&self.current), told(&self.previous)], self.blocks)
    }

    /// Restores the ranges returned by [`told`](Self::told).
    pub fn of_told(&([current, previous], blocks): &([Told; 2], usize)) -> Self {
        let ranges = |told: Told| {
            let mut ranges = Ranges::NONE;
            for (f, range) in told.into_iter().enumerate() {
                if let Some([low, high]) = range {
                    ranges.low[f] = low;
                    ranges.high[f] = high;
                }
            }
            ranges
        };
        Self {
            current: ranges(current),
            previous: ranges(previous),
            blocks: blocks.min(Self::GENERATION),
        }
    }

    /// Returns whether `other` exceeds the ranges of both generations; see [`Ranges::is_left_by`].
    pub fn is_left_by(&self, other: &Ranges, slack: f64) -> bool {
        let mut all = self.current;
        all.join(&self.previous);
        all.is_left_by(other, slack)
    }
}

/// Sums of one joint over a block.
#[derive(Debug, Clone)]
pub(super) struct JointBlock {
    /// Sums over the rows in which the joint moves.
    pub own: Moments,
    pub payload: Outer<PAYLOAD>,
    /// Sums for a force, by the joint on whose child link it acts.
    pub force: Vec<Outer<FORCE>>,
    pub ranges: Ranges,
    /// Whether its motion is outside the known ranges.
    pub novel: bool,
}

/// Sums over half a second of motion.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// First and last stamp \[ns since the epoch\].
    pub first_ns: i64,
    pub last_ns: i64,
    pub rows: u32,
    pub joints: Vec<JointBlock>,
    /// Joints whose residual is far above its baseline: bit j for joint j.
    pub loud: u32,
    /// Whether the block belongs to a contact or is an outlier: it is used neither for learning nor for judging.
    pub excluded: bool,
}

impl Block {
    fn new(joints: usize) -> Self {
        let joint = JointBlock {
            own: Moments::ZERO,
            payload: Outer::zero(),
            force: vec![Outer::zero(); joints],
            ranges: Ranges::NONE,
            novel: false,
        };
        Self {
            first_ns: 0,
            last_ns: 0,
            rows: 0,
            joints: vec![joint; joints],
            loud: 0,
            excluded: false,
        }
    }

    fn clear(&mut self) {
        self.rows = 0;
        self.loud = 0;
        self.excluded = false;
        for joint in &mut self.joints {
            joint.own = Moments::ZERO;
            joint.payload = Outer::zero();
            joint.force.fill(Outer::zero());
            joint.ranges = Ranges::NONE;
            joint.novel = false;
        }
    }

    /// Adds a row.
    pub fn add(&mut self, row: &Row) {
        if self.rows == 0 {
            self.first_ns = row.stamp_ns;
        }
        self.last_ns = row.stamp_ns;
        self.rows += 1;
        for (j, joint) in self.joints.iter_mut().enumerate() {
            if row.moving & (1 << j) == 0 {
                continue;
            }
            let own = &row.joints[j];
            joint.own.add_row(own);
            joint.payload.add_row(&row.payload[j], own);
            for (force, columns) in joint.force.iter_mut().zip(&row.force[j]) {
                force.add_row(columns, own);
            }
            joint
                .ranges
                .take([row.position[j], row.velocity[j], own.columns[1]]);
        }
    }
}

/// The newest complete blocks, and the open one. Nothing is allocated after construction.
#[derive(Debug)]
pub(super) struct Ring {
    blocks: Vec<Block>,
    /// Index of the open block, and number of complete ones before it.
    at: usize,
    len: usize,
}

impl Ring {
    /// Creates a ring for `capacity` complete blocks.
    pub fn new(capacity: usize, joints: usize) -> Self {
        Self {
            blocks: vec![Block::new(joints); capacity + 1],
            at: 0,
            len: 0,
        }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns the open block.
    pub fn open(&mut self) -> &mut Block {
        &mut self.blocks[self.at]
    }

    /// Completes the open block. The oldest one is dropped if the ring is full.
    pub fn close(&mut self) {
        self.at = (self.at + 1) % self.blocks.len();
        self.len = (self.len + 1).min(self.blocks.len() - 1);
        self.blocks[self.at].clear();
    }

    fn place(&self, back: usize) -> usize {
        (self.at + self.blocks.len() - 1 - back) % self.blocks.len()
    }

    /// Returns a complete block, counted from the newest (0).
    pub fn back(&self, back: usize) -> &Block {
        &self.blocks[self.place(back)]
    }

    pub fn back_mut(&mut self, back: usize) -> &mut Block {
        let place = self.place(back);
        &mut self.blocks[place]
    }

    /// Keeps only the `newest` complete blocks.
    pub fn keep(&mut self, newest: usize) {
        self.len = self.len.min(newest);
    }
}
