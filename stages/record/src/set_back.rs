//! A clock of reception that is set back.

use crate::streams::Streams;

/// A time of reception that is so far below the one before in its stream is of a clock that was set back \[ns\].
/// Resolution: what is left in order comes within less.
const SET_BACK_NS: i64 = 1_000_000_000;

/// Notices that the clock was set back. Each stream is compared with itself: one of another host comes late behind a
/// network that was cut, and its clock is as it was.
#[derive(Debug)]
pub(crate) struct SetBack {
    /// By stream: when its newest sample was received \[ns since the epoch\], and how often the clock was set back by then.
    newest: Vec<(Option<i64>, u64)>,
    /// The most of those.
    times: u64,
}

impl SetBack {
    pub fn new(streams: &Streams) -> Self {
        Self {
            newest: vec![(None, 0); streams.all.len()],
            times: 0,
        }
    }

    /// Notes when a sample of the stream number `index` was received. Where that is the first to tell that the clock was
    /// set back, by how much \[ns\].
    pub fn note(&mut self, index: usize, received_ns: i64) -> Option<i64> {
        let (newest_ns, times) = self.newest.get_mut(index)?;
        let before_ns = newest_ns.replace(received_ns).unwrap_or(received_ns);
        let back_ns = before_ns.saturating_sub(received_ns);
        if back_ns <= SET_BACK_NS {
            return None;
        }
        *times += 1;
        let is_first = *times > self.times;
        self.times = self.times.max(*times);
        is_first.then_some(back_ns)
    }
}
