//! Emits recorded or simulated samples at the rate of their stamps, or at a multiple of it.
//!
//! Only [`Paced`] delays samples by a clock. It wraps a source, so that the source itself needs none. It does not
//! sleep: it says when the next sample is due ([`Progress::Until`]).

use std::collections::VecDeque;
use std::task::Waker;
use std::time::{Duration, Instant};

use tauscope_bus::{Emit, LinkError, Progress, Sample, Source, StageError, flags};

/// Longest gap in the stamps that is waited out \[ns\]; a longer one is skipped.
/// Chosen: a pause of the robot within a session is waited out; a longer one is a break between sessions.
const LONGEST_PAUSE_NS: i64 = 60_000_000_000;

/// A source that emits the samples of another in step with their stamps.
#[derive(Debug)]
pub struct Paced<S, T> {
    inner: S,
    /// Seconds of stamps per second of real time.
    factor: f64,
    /// A reference instant, and the stamp that was due then.
    anchor: Option<(Instant, i64)>,
    newest_ns: i64,
    held: VecDeque<T>,
    ended: bool,
}

impl<S, T> Paced<S, T> {
    /// Plays `inner` at `factor` times the rate of its stamps; `factor` is above zero.
    pub fn new(inner: S, factor: f64) -> Self {
        Self {
            inner,
            factor,
            anchor: None,
            newest_ns: 0,
            held: VecDeque::new(),
            ended: false,
        }
    }

    /// Returns the instant at which the sample with this stamp is due.
    fn due(&mut self, stamp_ns: i64, reset: bool) -> Instant {
        let pause_ns = stamp_ns - self.newest_ns;
        if let Some((moment, at_ns)) = self.anchor
            && !reset
            && (0..=LONGEST_PAUSE_NS).contains(&pause_ns)
        {
            let seconds = (stamp_ns - at_ns) as f64 * 1e-9 / self.factor;
            return moment + Duration::try_from_secs_f64(seconds).unwrap_or_default();
        }
        let now = Instant::now();
        self.anchor = Some((now, stamp_ns));
        self.newest_ns = stamp_ns;
        now
    }
}

struct Hold<'a, T>(&'a mut VecDeque<T>);

impl<T: Sample> Emit<T> for Hold<'_, T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut slot = T::default();
        write(&mut slot);
        self.0.push_back(slot);
        Ok(())
    }
}

impl<T: Sample, S: Source<T>> Source<T> for Paced<S, T> {
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        if self.held.is_empty() {
            if self.ended {
                return Ok(Progress::End);
            }
            match self.inner.step(&mut Hold(&mut self.held))? {
                Progress::End => self.ended = true,
                Progress::Idle => return Ok(Progress::Idle),
                Progress::More | Progress::Until(_) => {}
            }
        }
        let Some(header) = self.held.front().map(|sample| *sample.header()) else {
            return Ok(Progress::More);
        };
        let due = self.due(header.stamp_ns, header.has(flags::RESET));
        if due > Instant::now() {
            return Ok(Progress::Until(due));
        }
        if let Some(sample) = self.held.pop_front() {
            self.newest_ns = header.stamp_ns;
            out.emit(&mut |slot| *slot = sample)?;
        }
        Ok(Progress::More)
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use tauscope_bus::JointState;

    /// Emits samples with the given stamps, two at a time.
    struct Stamps(Vec<i64>);

    impl Source<JointState> for Stamps {
        fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
            for _ in 0..2 {
                if self.0.is_empty() {
                    return Ok(Progress::End);
                }
                let stamp_ns = self.0.remove(0);
                out.emit(&mut |slot| slot.header.stamp_ns = stamp_ns)?;
            }
            Ok(Progress::More)
        }
    }

    #[derive(Default)]
    struct Times(Vec<(Instant, i64)>);

    impl Emit<JointState> for Times {
        fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
            let mut slot = JointState::default();
            write(&mut slot);
            self.0.push((Instant::now(), slot.header.stamp_ns));
            Ok(())
        }
    }

    fn run(stamps_ms: &[i64], factor: f64) -> (Duration, Vec<i64>) {
        let stamps = stamps_ms.iter().map(|ms| ms * 1_000_000).collect();
        let mut source = Paced::new(Stamps(stamps), factor);
        let mut times = Times::default();
        let begin = Instant::now();
        loop {
            match source.step(&mut times).unwrap() {
                Progress::End => break,
                Progress::Until(due) => {
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                }
                Progress::More | Progress::Idle => {}
            }
        }
        let end = times.0.last().unwrap().0;
        let stamps = times.0.iter().map(|(_, ns)| ns / 1_000_000).collect();
        (end - begin, stamps)
    }

    #[test]
    fn a_factor_stretches_the_time_between_stamps() {
        let (took, stamps) = run(&[1000, 1100, 1200, 1300], 2.0);
        assert_eq!(stamps, [1000, 1100, 1200, 1300]);
        assert!(took >= Duration::from_millis(149), "{took:?}");
    }

    #[test]
    fn neither_a_clock_set_back_nor_a_lost_day_is_waited_for() {
        let day_ms = 86_400_000;
        let (took, stamps) = run(&[2000, 2010, 1000, 1010, 1010 + day_ms, 1020 + day_ms], 1.0);
        assert_eq!(stamps.len(), 6);
        assert!(took >= Duration::from_millis(29), "{took:?}");
        assert!(took < Duration::from_secs(5), "{took:?}");
    }
}
