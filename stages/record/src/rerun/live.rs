//! The picture in a viewer that may connect and disconnect at any time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rerun::external::re_uri::ProxyUri;
use rerun::log::LogMsg;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink};

use super::queue::{Counts, NewestQueue, Next};
use crate::error::RecordError;

/// Capacity of the queue to the viewer \[messages\], some 10 s of one cell.
/// Resolution: memory.
const QUEUE_CAPACITY: usize = 1024;
/// Poll interval of the connection status while there are no messages.
/// Resolution: delay until a lost connection is noticed.
const LOOK: Duration = Duration::from_millis(50);
/// Delay before reconnecting to a viewer that disconnected.
/// Resolution: delay until a viewer is found again.
const RECONNECT: Duration = Duration::from_millis(500);
/// Longest time that the end of a run waits for the viewer to receive the remaining messages.
/// Resolution: acceptable duration of the end of a run.
const EXIT_PATIENCE: Duration = Duration::from_secs(2);

/// A stream to a viewer. It never blocks the pipeline: messages that the viewer does not receive in time are dropped
/// in favour of newer ones. A viewer that connects later, or reconnects, shows the picture from then on.
pub(super) struct Live {
    queue: Arc<NewestQueue<LogMsg>>,
    ever_connected: Arc<AtomicBool>,
    url: String,
}

impl Live {
    /// Starts to connect. Each new connection begins with the `preamble`.
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
        // The thread is not joined, because without a viewer Rerun's client needs seconds to give up.
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

    /// Waits a short time for a connected viewer to receive the remaining messages.
    pub fn finish(&self) {
        self.queue.close();
        self.queue.wait_finished(EXIT_PATIENCE);
        let Counts { pushed, dropped } = self.queue.counts();
        let url = &self.url;
        if !self.ever_connected.load(Ordering::Relaxed) {
            tracing::warn!("no Rerun viewer was running at {url}: the live picture was not shown");
        } else if dropped > 0 {
            tracing::warn!(
                "the Rerun viewer at {url} was disconnected or too slow for {dropped} of {pushed} messages"
            );
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // The thread ends when the queue is closed.
        self.queue.close();
    }
}

/// State of the sender thread.
struct Sender {
    uri: ProxyUri,
    preamble: Vec<LogMsg>,
    queue: Arc<NewestQueue<LogMsg>>,
    ever_connected: Arc<AtomicBool>,
}

/// Reason for the end of a connection.
enum Served {
    /// The stream ended before a connection was established.
    NeverConnected,
    /// The viewer disconnected.
    Gone,
    /// The stream ended.
    Ended,
}

impl Sender {
    fn run(self) {
        loop {
            let sink = GrpcSink::new(self.uri.clone());
            match self.serve(&sink) {
                Served::NeverConnected => {
                    // Finish first, because dropping a sink that is still connecting takes seconds.
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

    /// Sends the preamble and the queue to one connection.
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
