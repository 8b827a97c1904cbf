//! A stream between stages of one thread. A sample stays in place until all readers have read it.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tauscope_bus::{Header, Received, Sample, flags};

/// Buffer of the samples of one step of the source.
#[derive(Debug)]
pub(super) struct Lane<T> {
    stage: String,
    samples: RefCell<Vec<T>>,
    /// Number of `samples` that each reader has read.
    taken: RefCell<Vec<Rc<Cell<usize>>>>,
    sent: Cell<u64>,
    refused: Cell<bool>,
    ended: Cell<bool>,
}

impl<T: Sample> Lane<T> {
    /// Creates the output buffer of the stage of that name.
    pub fn of(stage: &str) -> Rc<Self> {
        Rc::new(Self {
            stage: stage.to_owned(),
            samples: RefCell::default(),
            taken: RefCell::default(),
            sent: Cell::new(0),
            refused: Cell::new(false),
            ended: Cell::new(false),
        })
    }

    /// Lets `write` fill a new sample, numbers it and stores it for the readers. Like a link between processes, it
    /// drops invalid samples.
    pub fn write(&self, write: &mut dyn FnMut(&mut T)) -> Header {
        let mut samples = self.samples.borrow_mut();
        let place = samples.len();
        samples.push(T::default());
        let sample = &mut samples[place];
        write(sample);
        let header = sample.header_mut();
        header.sequence = self.sent.get();
        let header = *header;
        self.sent.set(header.sequence + 1);
        if let Err(why) = sample.check() {
            samples.truncate(place);
            if !self.refused.replace(true) {
                let stage = &self.stage;
                tracing::warn!(
                    "stream of `{stage}`: a sample with {why} is refused; further ones are only counted"
                );
            }
        } else if header.has(flags::END) {
            samples.truncate(place);
            self.end();
        }
        header
    }

    /// Marks the end of the stream.
    pub fn end(&self) {
        self.ended.set(true);
    }

    /// Number of samples written.
    pub fn sent(&self) -> u64 {
        self.sent.get()
    }

    /// Creates a reader of all samples written from now on.
    pub fn reader(self: &Rc<Self>) -> Reader<T> {
        let taken = Rc::new(Cell::new(self.samples.borrow().len()));
        self.taken.borrow_mut().push(Rc::clone(&taken));
        Reader {
            lane: Rc::clone(self),
            taken,
            received: 0,
        }
    }
}

/// A lane, independent of its sample type.
pub(super) trait Tidy {
    /// Clears the buffer once every reader has read all samples.
    fn tidy(&self);
}

impl<T: Sample> Tidy for Lane<T> {
    fn tidy(&self) {
        let mut samples = self.samples.borrow_mut();
        let taken = self.taken.borrow();
        if !samples.is_empty() && taken.iter().all(|taken| taken.get() == samples.len()) {
            taken.iter().for_each(|taken| taken.set(0));
            samples.clear();
        }
    }
}

/// Reader of a lane.
#[derive(Debug)]
pub(super) struct Reader<T> {
    lane: Rc<Lane<T>>,
    taken: Rc<Cell<usize>>,
    received: u64,
}

impl<T: Sample> Reader<T> {
    /// Passes the next sample to `read` in place.
    pub fn receive<R>(&mut self, read: impl FnOnce(&T) -> R) -> (Received, Option<R>) {
        let samples = self.lane.samples.borrow();
        let Some(sample) = samples.get(self.taken.get()) else {
            let over = self.lane.ended.get();
            return (
                if over {
                    Received::End
                } else {
                    Received::Nothing
                },
                None,
            );
        };
        self.taken.set(self.taken.get() + 1);
        self.received += 1;
        (Received::Sample, Some(read(sample)))
    }

    /// Number of samples read.
    pub fn received(&self) -> u64 {
        self.received
    }
}

#[cfg(test)]
mod tests {
    use tauscope_bus::JointState;

    use super::*;

    fn write(lane: &Lane<JointState>, stamp_ns: i64) {
        lane.write(&mut |sample| sample.header.stamp_ns = stamp_ns);
    }

    fn read(reader: &mut Reader<JointState>) -> Option<(i64, u64)> {
        reader
            .receive(|sample| (sample.header.stamp_ns, sample.header.sequence))
            .1
    }

    #[test]
    fn every_reader_is_given_every_sample_in_its_own_time() {
        let lane = Lane::of("in");
        let (mut fast, mut slow) = (lane.reader(), lane.reader());
        write(&lane, 10);
        assert_eq!(read(&mut fast), Some((10, 0)));
        lane.tidy();
        write(&lane, 20);
        assert_eq!(read(&mut fast), Some((20, 1)));
        assert_eq!(
            read(&mut slow),
            Some((10, 0)),
            "nothing goes before it is read"
        );
        assert_eq!(read(&mut slow), Some((20, 1)));
        lane.tidy();
        assert!(lane.samples.borrow().is_empty());
        write(&lane, 30);
        assert_eq!(
            (read(&mut fast), read(&mut slow)),
            (Some((30, 2)), Some((30, 2)))
        );
        lane.end();
        assert_eq!(fast.receive(|_| ()).0, Received::End);
        assert_eq!((fast.received(), lane.sent()), (3, 3));
    }

    #[test]
    fn what_no_stage_may_see_is_kept_back_and_keeps_its_number() {
        let lane = Lane::of("in");
        let mut reader = lane.reader();
        lane.write(&mut |sample: &mut JointState| sample.position[0] = f64::NAN);
        lane.write(&mut |sample: &mut JointState| sample.header.joint_count = u32::MAX);
        write(&lane, 30);
        assert_eq!(read(&mut reader), Some((30, 2)));
        assert_eq!(reader.received(), 1);
    }
}
