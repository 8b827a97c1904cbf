//! Files around alarms: what came before an alarm waits in memory.
//!
//! Samples wait in a ring. An alarm opens files, into which the ring is emptied a few samples at a time,
//! so that no sample has to wait while thousands are written. The files stay open until no alarm could
//! come any more whose time before it reaches back into them. All times are the samples' own. Where the
//! clock of reception is set back, other files begin.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;

use tauscope_bus::{Detection, Health, JointState, SampleRef, TwinState};

use crate::config::{AroundAlarms as Settings, Config};
use crate::contacts::Contacts;
use crate::error::RecordError;
use crate::files::Files;
use crate::set_back::SetBack;
use crate::streams::Streams;

/// Samples that are written for each that comes, while there are any to be.
/// Resolution: how long a sample waits, against how long the ring stays full.
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
    /// Up to which time files are to hold all, while they are open.
    until_ns: Option<i64>,
    clock: SetBack,
    /// How often the clock of reception was set back: by now, and before the samples of the open files.
    set_back: u64,
    written_set_back: u64,
    /// The ring was too small, and that was said.
    told: bool,
}

/// A sample that waits, with its stream's number.
struct Waiting {
    index: usize,
    /// By the clock of reception as it stands now \[ns since the epoch\].
    received_ns: i64,
    /// How often that clock had been set back when the sample was received.
    set_back: u64,
    sample: Sample,
}

/// A sample of the ring's own.
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
    /// What it takes in memory \[bytes\].
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

    /// Takes a sample of the stream number `index`.
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

    /// The clock of reception was set back: what waits was received as long ago as before, by the new time.
    fn set_back(&mut self, by_ns: i64) {
        self.set_back += 1;
        for waiting in &mut self.ring {
            waiting.received_ns = waiting.received_ns.saturating_sub(by_ns);
        }
        if let Some(until_ns) = &mut self.until_ns {
            *until_ns = until_ns.saturating_sub(by_ns);
        }
    }

    /// Gives up what is older than an alarm that comes now would ask for, or what there is no memory for.
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
                // What is given up now would be missing in the middle if the files were gone on with.
                self.close(streams)?;
            }
            if let Some(waiting) = self.pop() {
                self.contacts
                    .push(streams, waiting.index, waiting.sample.as_ref());
            }
        }
        Ok(())
    }

    /// Writes the sample that waits longest, if it belongs to files that are open.
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
            // A file is read in the order of reception: what came behind would come first.
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

    /// Completes the files that are open, with what still belongs to them.
    fn close(&mut self, streams: &Streams) -> Result<(), RecordError> {
        while self.write_next(streams)? {}
        self.until_ns = None;
        self.files.finish(streams)
    }

    /// Hands what belongs to open files to the operating system: nothing comes for the moment.
    pub fn flush(&mut self, streams: &Streams) -> Result<(), RecordError> {
        while self.write_next(streams)? {}
        self.files.flush()
    }

    /// Completes the files of an alarm that the end came close to.
    pub fn finish(&mut self, streams: &Streams) -> Result<(), RecordError> {
        self.close(streams)
    }

    /// The files that were completed last, and how many in all.
    pub fn completed(&self) -> (&[PathBuf], u64) {
        self.files.completed()
    }

    /// Samples that the disk had no room for.
    pub fn dropped(&self) -> u64 {
        self.files.dropped()
    }
}
