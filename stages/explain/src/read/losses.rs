//! What a recording loses on reading.

/// What was left out on reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Losses {
    /// Rows whose numbers are not finite.
    pub not_finite: u64,
    /// Rows that repeat the stamp of the row before.
    pub repeated: u64,
    /// Rows whose stamp lies before that of the row before.
    pub backward: u64,
    /// Rows in which a joint of the robot is missing.
    pub incomplete: u64,
    /// Messages that could not be read.
    pub unreadable: u64,
    /// Parts of the file that cannot be read, e.g. a torn tail.
    pub damaged: u64,
}

impl Losses {
    /// Rows of data that are lost, repeats not counted.
    pub fn lost(&self) -> u64 {
        self.not_finite + self.backward + self.incomplete + self.unreadable + self.damaged
    }
}
