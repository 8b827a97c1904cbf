//! Reading of a source on its own thread, some samples ahead of the consumer.
//!
//! Reading a recording takes about as long as computing on it, so two cores do both in little more than half the
//! time. The output is identical to the byte: each step of the source is forwarded unchanged, with its samples and
//! with the source's counts at that step.

use std::io;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use tauscope_bus::{Emit, LinkError, Progress, Sample, Source, StageError};

/// Number of samples in a batch.
/// Resolution: a thread is woken for each batch; 256 joint states are a quarter of a second at 1 kHz, and 300 kB.
const BATCH: usize = 256;
/// Number of batches in circulation, full or empty.
/// Resolution: memory; one is filled, one is consumed, one waits.
const BATCHES: usize = 3;

/// Buffer of emitted samples.
#[derive(Debug)]
struct Kept<T>(Vec<T>);

/// Samples and results of consecutive steps of a source.
struct Batch<T> {
    samples: Kept<T>,
    steps: Vec<Step>,
    /// Error of the last step, if it failed.
    failure: Option<StageError>,
}

/// One step of the source.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// End of its samples in the batch, exclusive.
    end: usize,
    /// Progress that the step returned; `None` if it failed.
    progress: Option<Progress>,
    standing: Standing,
}

/// Counts of a source after a step.
#[derive(Debug, Clone, Copy)]
struct Standing {
    dropped: u64,
    fraction_done: Option<f64>,
}

impl Standing {
    fn of<T: Sample>(source: &impl Source<T>) -> Self {
        Self {
            dropped: source.dropped(),
            fraction_done: source.fraction_done(),
        }
    }
}

impl<T: Sample> Emit<T> for Kept<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let place = self.0.len();
        self.0.push(T::default());
        write(&mut self.0[place]);
        Ok(())
    }
}

impl<T: Sample> Batch<T> {
    fn new() -> Self {
        Self {
            samples: Kept(Vec::with_capacity(BATCH)),
            steps: Vec::new(),
            failure: None,
        }
    }

    /// Runs steps of `source` until the batch is full; returns whether more may follow.
    fn fill(&mut self, source: &mut impl Source<T>) -> bool {
        self.samples.0.clear();
        self.steps.clear();
        loop {
            let stepped = source.step(&mut self.samples);
            let progress = stepped.map_err(|error| self.failure = Some(error)).ok();
            self.steps.push(Step {
                end: self.samples.0.len(),
                progress,
                standing: Standing::of(source),
            });
            match progress {
                Some(Progress::More)
                    if self.samples.0.len() < BATCH && self.steps.len() < BATCH => {}
                // An idle source waits for a peer: forward its samples before that wait.
                Some(Progress::More | Progress::Idle | Progress::Until(_)) => return true,
                Some(Progress::End) | None => return false,
            }
        }
    }
}

/// The channel of full batches, and the channel that returns empty ones to the reader.
type Channels<T> = (Receiver<Batch<T>>, SyncSender<Batch<T>>);

/// A source that is read ahead of its consumer. Not for live sources: [`Source::trouble`] is not forwarded.
pub struct Ahead<T> {
    /// `None` after the end.
    channels: Option<Channels<T>>,
    batch: Batch<T>,
    /// Number of steps of the batch already forwarded.
    stepped: usize,
    /// Number of samples of the batch already forwarded.
    taken: usize,
    standing: Standing,
    reader: Option<JoinHandle<()>>,
}

impl<T: Sample> Ahead<T> {
    /// Starts a thread that reads `source`.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub fn new(mut source: impl Source<T> + 'static) -> io::Result<Self> {
        let standing = Standing::of(&source);
        let (give, full) = sync_channel(BATCHES);
        let (back, empty) = sync_channel(BATCHES);
        for _ in 1..BATCHES {
            // Cannot fail: the channel has capacity for all batches.
            let _ = back.try_send(Batch::new());
        }
        let read = move || {
            // A closed channel means that the consumer is gone.
            while let Ok(mut batch) = empty.recv() {
                let goes_on = Batch::fill(&mut batch, &mut source);
                if give.send(batch).is_err() || !goes_on {
                    return;
                }
            }
        };
        let reader = std::thread::Builder::new().name("reader".to_owned());
        Ok(Self {
            channels: Some((full, back)),
            batch: Batch::new(),
            stepped: 0,
            taken: 0,
            standing,
            reader: Some(reader.spawn(read)?),
        })
    }

    /// Replaces the consumed batch by the next full one.
    fn exchange(&mut self) {
        let Some((full, back)) = &self.channels else {
            return;
        };
        let Ok(batch) = full.recv() else {
            self.end();
            return;
        };
        // Fails once the reader has reached the end and exited.
        let _ = back.try_send(std::mem::replace(&mut self.batch, batch));
        (self.stepped, self.taken) = (0, 0);
    }

    /// Waits for the reader, which reads at most one more batch. Propagates a panic of the reader to this thread.
    fn end(&mut self) {
        self.channels = None;
        if let Some(Err(panic)) = self.reader.take().map(JoinHandle::join)
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

impl<T: Sample> Source<T> for Ahead<T> {
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        if self.stepped == self.batch.steps.len() {
            self.exchange();
        }
        let Some(step) = self.batch.steps.get(self.stepped).copied() else {
            return Ok(Progress::End);
        };
        self.stepped += 1;
        let samples = &self.batch.samples.0[self.taken..step.end];
        self.taken = step.end;
        self.standing = step.standing;
        for sample in samples {
            out.emit(&mut |slot| *slot = *sample)?;
        }
        match (step.progress, self.batch.failure.take()) {
            (Some(progress), failure) => {
                self.batch.failure = failure;
                Ok(progress)
            }
            (None, Some(failure)) => Err(failure),
            (None, None) => Ok(Progress::End),
        }
    }

    fn dropped(&self) -> u64 {
        self.standing.dropped
    }

    fn fraction_done(&self) -> Option<f64> {
        self.standing.fraction_done
    }
}

impl<T> Drop for Ahead<T> {
    fn drop(&mut self) {
        self.channels = None;
        if let Some(reader) = self.reader.take() {
            // A panic of the reader is not propagated: the consumer stopped early, for a reason of its own.
            let _ = reader.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use tauscope_bus::JointState;

    use super::*;

    /// A source with steps of 0 to 4 samples, whose counts change with every step.
    struct Steps {
        step: u64,
        sent: i64,
        last: u64,
        failing: bool,
    }

    impl Source<JointState> for Steps {
        fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
            self.step += 1;
            for _ in 0..self.step % 5 {
                self.sent += 1;
                out.emit(&mut |sample| sample.header.stamp_ns = self.sent)?;
            }
            match self.step {
                step if step < self.last && step.is_multiple_of(7) => Ok(Progress::Idle),
                step if step < self.last => Ok(Progress::More),
                _ if self.failing => Err(StageError::Unfit("torn".to_owned())),
                _ => Ok(Progress::End),
            }
        }

        fn dropped(&self) -> u64 {
            self.step / 3
        }

        fn fraction_done(&self) -> Option<f64> {
            Some(self.step as f64 / self.last as f64)
        }
    }

    fn steps(failing: bool) -> Steps {
        Steps {
            step: 0,
            sent: 0,
            last: 1500,
            failing,
        }
    }

    /// Samples, result and counts of each step of a source.
    fn all(mut source: impl Source<JointState>) -> Vec<String> {
        let mut told = vec![format!("{} {:?}", source.dropped(), source.fraction_done())];
        loop {
            let mut samples = Kept(Vec::new());
            let stepped = source.step(&mut samples);
            let stamps: Vec<_> = samples
                .0
                .iter()
                .map(|s: &JointState| s.header.stamp_ns)
                .collect();
            let counts = (source.dropped(), source.fraction_done());
            let ends = !matches!(stepped, Ok(Progress::More | Progress::Idle));
            told.push(format!("{stamps:?} {stepped:?} {counts:?}"));
            if ends {
                return told;
            }
        }
    }

    #[test]
    fn every_step_comes_as_without_a_thread_also_the_one_that_fails() {
        for failing in [false, true] {
            let ahead = all(Ahead::new(steps(failing)).unwrap());
            assert_eq!(ahead, all(steps(failing)));
            assert_eq!(ahead.len(), 1501);
        }
    }

    #[test]
    fn it_can_be_left_in_the_middle() {
        let mut source = Ahead::new(steps(false)).unwrap();
        let mut samples = Kept(Vec::new());
        source.step(&mut samples).unwrap();
        drop(source);
        assert_eq!(samples.0.len(), 1);
    }

    struct Panics;

    impl Source<JointState> for Panics {
        fn step(&mut self, _: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
            panic!("the file is gone");
        }
    }

    #[test]
    fn a_panic_of_the_reader_is_one_of_who_takes() {
        let mut source = Ahead::new(Panics).unwrap();
        let step =
            std::panic::AssertUnwindSafe(|| source.step(&mut Kept::<JointState>(Vec::new())));
        let panic = std::panic::catch_unwind(step).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"the file is gone"));
    }
}
