//! Half seconds of motion, and the newest of them in a ring.

use super::moments::{Moments, Outer};
use super::rows::{FORCE, PAYLOAD, Row};

/// Rows in a block: half a second of motion.
pub(super) const BLOCK_ROWS: u32 = 10;
/// How long a block is in motion \[s\].
pub(super) const BLOCK_S: f64 = 0.5;
/// Features in which a motion may be unlike what was seen: position, velocity, expected effort.
pub(super) const FEATURES: usize = 3;

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

    /// Whether `other` lies outside by more than a share `slack` of this range, in any feature.
    fn is_left_by(&self, other: &Self, slack: f64) -> bool {
        (0..FEATURES).any(|f| {
            let slack = slack * (self.high[f] - self.low[f]);
            other.low[f] < self.low[f] - slack || other.high[f] > self.high[f] + slack
        })
    }
}

/// The ranges that a joint moved in lately. What was seen long ago the reference has forgotten, and so do they:
/// a program that comes back after many others is new again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Of the blocks since a multiple of [`Known::GENERATION`], and of as many before.
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
    /// As long as the reference remembers: 150 s of motion.
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

    /// See [`Ranges::is_left_by`].
    pub fn is_left_by(&self, other: &Ranges, slack: f64) -> bool {
        let mut all = self.current;
        all.join(&self.previous);
        all.is_left_by(other, slack)
    }
}

/// A joint in a block.
#[derive(Debug, Clone)]
pub(super) struct JointBlock {
    /// Of the rows in which it moves.
    pub own: Moments,
    pub payload: Outer<PAYLOAD>,
    /// By the joint whose child link is touched.
    pub force: Vec<Outer<FORCE>>,
    pub ranges: Ranges,
    /// Whether its motion is unlike what the reference has seen.
    pub novel: bool,
}

/// Half a second of motion.
#[derive(Debug, Clone)]
pub(super) struct Block {
    /// First and last stamp \[ns since the epoch\].
    pub first_ns: i64,
    pub last_ns: i64,
    pub rows: u32,
    pub joints: Vec<JointBlock>,
    /// The joints whose residual is far beyond what is usual.
    pub loud: u32,
    /// It belongs to a contact, and nothing is learned or judged from it.
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

/// The newest blocks, and one in the making. Nothing is allocated after it was made.
#[derive(Debug)]
pub(super) struct Ring {
    blocks: Vec<Block>,
    /// Place of the block in the making, and how many complete ones stand before it.
    at: usize,
    len: usize,
}

impl Ring {
    /// Room for so many complete blocks.
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

    /// The block in the making.
    pub fn open(&mut self) -> &mut Block {
        &mut self.blocks[self.at]
    }

    /// Completes it; the oldest gives way if there is no more room.
    pub fn close(&mut self) {
        self.at = (self.at + 1) % self.blocks.len();
        self.len = (self.len + 1).min(self.blocks.len() - 1);
        self.blocks[self.at].clear();
    }

    fn place(&self, back: usize) -> usize {
        (self.at + self.blocks.len() - 1 - back) % self.blocks.len()
    }

    /// A complete block, counted from the newest (0).
    pub fn back(&self, back: usize) -> &Block {
        &self.blocks[self.place(back)]
    }

    pub fn back_mut(&mut self, back: usize) -> &mut Block {
        let place = self.place(back);
        &mut self.blocks[place]
    }

    /// Keeps the newest so many.
    pub fn keep(&mut self, newest: usize) {
        self.len = self.len.min(newest);
    }
}
