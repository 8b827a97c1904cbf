//! Files around alarms, with the samples before each alarm buffered in memory.
//!
//! Samples are buffered in a ring. An alarm opens files, into which the ring is written a few samples at a time, so
//! that no new sample waits while thousands are written. The files stay open until the interval before a further
//! alarm could no longer overlap them. All times come from the samples. If the reception clock is set back, new files
//! are begun.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;

use tauscope_bus::{Detection, Health, JointState, SampleRef, TwinState};

use crate::config::{AroundAlarms as Settings, Config};
use crate::contacts::Contacts;
use crate::error::RecordError;
use crate::files::Files;
use crate::set_back::SetBack;
use crate::streams::Streams;

/// Largest number of buffered samples that are written per received sample.
/// Resolution: delay of a received sample, against the time to empty the ring.
const WRITTEN_PER_SAMPLE: usize = 8;

/// Files around alarms.
pub(crate) struct AroundAlarms {
    files: Files,
    contacts: Contacts,
    ring: VecDeque<Waiting>,
    bytes: usize,
    most_bytes: usize,
    before_ns: i64,
    after_ns: i64,
    /// Time up to which the open files record all samples.
    until_ns: Option<i64>,
    clock: SetBack,
    /// Number of times that the reception clock was set back: so far, and up to the last written sample.
    set_back: u64,
    written_set_back: u64,
    /// Whether a too small ring was already reported.
    told: bool,
}

/// A buffered sample, with its stream's number.
struct Waiting {
    index: usize,
    /// Reception time by the current setting of the clock \[ns since the epoch\].
    received_ns: i64,
    /// Number of times that the clock had been set back at reception.
    set_back: u64,
    sample: Sample,
}

/// An owned copy of a sample.
enum Sample {
    JointState(Box<JointState>),
    TwinState(Box<TwinState>),
    Detection(Box<Detection>),
    Health(Box<Health>),
}

impl Sample {
    fn of(sample: SampleRef<'_>) -> Self {
        match sample {
            SampleRef::JointState(sample) => Self::JointState(Box::new(*sample)),
            SampleRef::TwinState(sample) => Self::TwinState(Box::new(*sample)),
            SampleRef::Detection(sample) => Self::Detection(Box::new(*sample)),
            SampleRef::Health(sample) => Self::Health(Box::new(*sample)),
        }
    }

    fn as_ref(&self) -> SampleRef<'_> {
        match self {
            Self::JointState(sample) => SampleRef::JointState(sample),
            Self::TwinState(sample) => SampleRef::TwinState(sample),
            Self::Detection(sample) => SampleRef::Detection(sample),
            Self::Health(sample) => SampleRef::Health(sample),
        }
    }
}

impl Waiting {
    /// Memory use \[bytes\].
    fn bytes(&self) -> usize {
        size_of::<Self>()
            + match self.sample {
                Sample::JointState(_) => size_of::<JointState>(),
                Sample::TwinState(_) => size_of::<TwinState>(),
                Sample::Detection(_) => size_of::<Detection>(),
                Sample::Health(_) => size_of::<Health>(),
            }
    }
}

impl AroundAlarms {
    pub fn new(
        settings: &Settings,
        recorder: &Config,
        provenance: &BTreeMap<String, String>,
        streams: &Streams,
    ) -> Result<Self, RecordError> {
        let files = Files::later(&settings.files(recorder), provenance, streams)?;
        let ns = |seconds: f64| (seconds * 1e9).round() as i64;
        Ok(Self {
            files,
            contacts: Contacts::new(streams),
            ring: VecDeque::new(),
            bytes: 0,
            most_bytes: (settings.at_most_mb * 1e6) as usize,
            before_ns: ns(settings.before_s),
            after_ns: ns(settings.after_s),
            until_ns: None,
            clock: SetBack::new(streams),
            set_back: 0,
            written_set_back: 0,
            told: false,
        })
    }

    /// Buffers a sample of the stream number `index`, and writes buffered samples that belong to open files.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
    ) -> Result<(), RecordError> {
        let now_ns = sample.header().received_ns;
        if let Some(back_ns) = self.clock.note(index, now_ns) {
            self.set_back(back_ns);
        }
        if matches!(sample, SampleRef::Detection(detection) if detection.alarm()) {
            let until_ns = now_ns.saturating_add(self.after_ns);
            self.until_ns = Some(self.until_ns.map_or(until_ns, |ns| ns.max(until_ns)));
        }
        let waiting = Waiting {
            index,
            received_ns: now_ns,
            set_back: self.set_back,
            sample: Sample::of(sample),
        };
        self.bytes += waiting.bytes();
        self.ring.push_back(waiting);
        for _ in 0..WRITTEN_PER_SAMPLE {
            if !self.write_next(streams)? {
                break;
            }
        }
        let oldest_ns = now_ns.saturating_sub(self.before_ns);
        if self.until_ns.is_some_and(|until_ns| until_ns < oldest_ns) {
            self.close(streams)?;
        }
        self.forget(streams, oldest_ns)
    }

    /// Shifts the times of buffered samples after the reception clock was set back, so that their age is unchanged.
    fn set_back(&mut self, by_ns: i64) {
        self.set_back += 1;
        for waiting in &mut self.ring {
            waiting.received_ns = waiting.received_ns.saturating_sub(by_ns);
        }
        if let Some(until_ns) = &mut self.until_ns {
            *until_ns = until_ns.saturating_sub(by_ns);
        }
    }

    /// Removes samples that are older than an alarm now would need, or that exceed the memory limit.
    fn forget(&mut self, streams: &Streams, oldest_ns: i64) -> Result<(), RecordError> {
        while let Some(first) = self.ring.front() {
            let too_much = self.bytes > self.most_bytes;
            if first.received_ns >= oldest_ns && !too_much {
                return Ok(());
            }
            if too_much && !std::mem::replace(&mut self.told, true) {
                tracing::warn!(
                    "`around_alarms` holds less than `before_s`: `at_most_mb` is too small for it"
                );
            }
            if self.write_next(streams)? {
                continue;
            }
            if self.until_ns.is_some() {
                // The removed sample would leave a gap in the open files.
                self.close(streams)?;
            }
            if let Some(waiting) = self.pop() {
                self.contacts
                    .push(streams, waiting.index, waiting.sample.as_ref());
            }
        }
        Ok(())
    }

    /// Writes the oldest buffered sample, if it belongs to the open files.
    fn write_next(&mut self, streams: &Streams) -> Result<bool, RecordError> {
        let belongs = |first: &Waiting| {
            self.until_ns
                .is_some_and(|until_ns| first.received_ns <= until_ns)
        };
        if !self.ring.front().is_some_and(belongs) {
            return Ok(false);
        }
        let Some(waiting) = self.pop() else {
            return Ok(false);
        };
        if std::mem::replace(&mut self.written_set_back, waiting.set_back) != waiting.set_back {
            // Files are read in the order of reception times, so samples after the clock step would be sorted first.
            self.files.finish(streams)?;
        }
        let sample = waiting.sample.as_ref();
        let told = self.contacts.push(streams, waiting.index, sample);
        self.files.accept(streams, waiting.index, sample, &told)?;
        Ok(true)
    }

    fn pop(&mut self) -> Option<Waiting> {
        let waiting = self.ring.pop_front()?;
        self.bytes -= waiting.bytes();
        Some(waiting)
    }

    /// Completes the open files, with the buffered samples that belong to them.
    fn close(&mut self, streams: &Streams) -> Result<(), RecordError> {
        while self.write_next(streams)? {}
        self.until_ns = None;
        self.files.finish(streams)
    }

    /// Flushes the samples of open files to the operating system during a pause of the input.
    pub fn flush(&mut self, streams: &Streams) -> Result<(), RecordError> {
        while self.write_next(streams)? {}
        self.files.flush()
    }

    /// Completes the open files at the end of the run.
    pub fn finish(&mut self, streams: &Streams) -> Result<(), RecordError> {
        self.close(streams)
    }

    /// Returns the most recently completed files, and the total number of completed files.
    pub fn completed(&self) -> (&[PathBuf], u64) {
        self.files.completed()
    }

    /// Number of samples that were lost because the disk was full.
    pub fn dropped(&self) -> u64 {
        self.files.dropped()
    }
}
