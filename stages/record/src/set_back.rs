//! Detection of a reception clock that is set back.

use crate::streams::Streams;

/// Decrease of the reception time within a stream above which the clock was set back \[ns\].
/// Resolution: reordering without a clock step stays below this.
const SET_BACK_NS: i64 = 1_000_000_000;

/// Detector of a clock that was set back. Each stream is compared only with itself, because after a network failure
/// the stream of another host may be late without a clock step.
#[derive(Debug)]
pub(crate) struct SetBack {
    /// Reception time of the newest sample \[ns since the epoch\] and number of clock steps in the stream, by stream.
    newest: Vec<(Option<i64>, u64)>,
    /// Largest number of clock steps in a stream.
    times: u64,
}

impl SetBack {
    pub fn new(streams: &Streams) -> Self {
        Self {
            newest: vec![(None, 0); streams.all.len()],
            times: 0,
        }
    }

    /// Records the reception time of a sample of the stream number `index`. Returns the size of a clock step \[ns\]
    /// when the first stream shows it.
    pub fn note(&mut self, index: usize, received_ns: i64) -> Option<i64> {
        let (newest_ns, times) = self.newest.get_mut(index)?;
        let before_ns = newest_ns.replace(received_ns).unwrap_or(received_ns);
        let back_ns = before_ns.saturating_sub(received_ns);
        if back_ns <= SET_BACK_NS {
            return None;
        }
        // Every stream sees the same step; only the first one reports it.
        *times += 1;
        let is_first = *times > self.times;
        self.times = self.times.max(*times);
        is_first.then_some(back_ns)
    }
}
