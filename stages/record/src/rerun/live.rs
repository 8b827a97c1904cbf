//! The picture in a viewer that may come and go.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rerun::external::re_uri::ProxyUri;
use rerun::log::LogMsg;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink};

use super::queue::{Counts, NewestQueue, Next};
use crate::error::RecordError;

/// Messages that wait for the viewer: some 10 s of one cell.
/// Resolution: memory.
const QUEUE_CAPACITY: usize = 1024;
/// How often a connection is looked after while nothing comes.
/// Resolution: how soon a lost connection is noticed.
const LOOK: Duration = Duration::from_millis(50);
/// How long to wait before connecting anew to a viewer that went away.
/// Resolution: how soon a viewer is found again.
const RECONNECT: Duration = Duration::from_millis(500);
/// How long the end of a run waits for the viewer to take what is left.
/// Resolution: how long the end of a run may take.
const EXIT_PATIENCE: Duration = Duration::from_secs(2);

/// A stream to a viewer. Never makes the pipeline wait: what the viewer does not take in time gives
/// way to what is newer. A viewer that comes later, or comes back, sees the picture from then on.
pub(super) struct Live {
    queue: Arc<NewestQueue<LogMsg>>,
    ever_connected: Arc<AtomicBool>,
    url: String,
}

impl Live {
    /// Starts to connect. Each new connection is first sent the `preamble`.
    pub fn start(url: &str, preamble: Vec<LogMsg>) -> Result<Self, RecordError> {
        let failed = |error: &dyn std::fmt::Display| RecordError::Connect {
            url: url.to_owned(),
            reason: error.to_string(),
        };
        let uri: ProxyUri = url.parse().map_err(|error| failed(&error))?;
        let queue = Arc::new(NewestQueue::new(QUEUE_CAPACITY));
        let ever_connected = Arc::new(AtomicBool::new(false));
        let sender = Sender {
            uri,
            preamble,
            queue: Arc::clone(&queue),
            ever_connected: Arc::clone(&ever_connected),
        };
        // Not joined: where no viewer was found, Rerun's client takes seconds to give up.
        std::thread::Builder::new()
            .name("rerun_live".to_owned())
            .spawn(move || sender.run())
            .map_err(|error| failed(&error))?;
        Ok(Self {
            queue,
            ever_connected,
            url: url.to_owned(),
        })
    }

    pub fn push(&self, message: LogMsg) {
        self.queue.push(message);
    }

    pub fn counts(&self) -> Counts {
        self.queue.counts()
    }

    /// Gives a viewer that is there a short time to take what is left.
    pub fn finish(&self) {
        self.queue.close();
        self.queue.wait_finished(EXIT_PATIENCE);
        let Counts { pushed, dropped } = self.queue.counts();
        let url = &self.url;
        if !self.ever_connected.load(Ordering::Relaxed) {
            tracing::warn!("no Rerun viewer was there at {url}: the live picture went nowhere");
        } else if dropped > 0 {
            tracing::warn!(
                "the Rerun viewer at {url} was away or too slow for {dropped} of {pushed} messages"
            );
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // The thread ends by itself.
        self.queue.close();
    }
}

/// What runs in the thread.
struct Sender {
    uri: ProxyUri,
    preamble: Vec<LogMsg>,
    queue: Arc<NewestQueue<LogMsg>>,
    ever_connected: Arc<AtomicBool>,
}

/// How a connection came to its end.
enum Served {
    /// There was none when the stream ended.
    NeverConnected,
    /// The viewer went away.
    Gone,
    /// The stream has ended.
    Ended,
}

impl Sender {
    fn run(self) {
        loop {
            let sink = GrpcSink::new(self.uri.clone());
            match self.serve(&sink) {
                Served::NeverConnected => {
                    // Dropping a sink that still connects takes seconds.
                    self.queue.finish();
                    return;
                }
                Served::Gone => {}
                Served::Ended => {
                    // Dropping the sink completes the transfer.
                    drop(sink);
                    self.queue.finish();
                    return;
                }
            }
            drop(sink);
            if self.queue.wait_closed(RECONNECT) {
                self.queue.finish();
                return;
            }
        }
    }

    /// Feeds one connection.
    fn serve(&self, sink: &GrpcSink) -> Served {
        loop {
            match sink.status() {
                GrpcSinkConnectionState::Connected => break,
                GrpcSinkConnectionState::Connecting { .. } => {
                    if self.queue.wait_closed(LOOK) {
                        return Served::NeverConnected;
                    }
                }
                GrpcSinkConnectionState::Disconnected(_) => return Served::Gone,
            }
        }
        self.ever_connected.store(true, Ordering::Relaxed);
        sink.send_all(self.preamble.clone());
        loop {
            if matches!(sink.status(), GrpcSinkConnectionState::Disconnected(_)) {
                return Served::Gone;
            }
            match self.queue.pop(LOOK) {
                Next::Item(message) => sink.send(message),
                Next::Nothing => {}
                Next::Closed => {
                    if let Err(error) = sink.flush_blocking(EXIT_PATIENCE) {
                        tracing::debug!("the Rerun viewer did not take everything: {error}");
                    }
                    return Served::Ended;
                }
            }
        }
    }
}
