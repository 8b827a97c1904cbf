//! Back-pressure: the wait of a sender for a receiver whose buffer is full.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use iceoryx2::port::{BackpressureAction, BackpressureInfo};

/// Number of retries before the first sleep; iceoryx2 yields between them.
/// Resolution: the delay of a sample, against computing time.
const YIELDS: u64 = 20;
/// Sleep between retries up to [`LONG_FROM`].
/// Resolution: the delay of a sample, against computing time.
const SHORT: Duration = Duration::from_micros(50);
/// Sleep between retries from [`LONG_FROM`] on.
/// Resolution: the delay of a sample, against computing time.
const LONG: Duration = Duration::from_millis(1);
/// Time after the first try from which on the sleep is [`LONG`].
/// Resolution: the delay of a sample, against computing time.
const LONG_FROM: Duration = Duration::from_millis(100);

/// State shared by a sender and the handler that iceoryx2 calls while a send is blocked.
#[derive(Debug)]
pub(super) struct Backpressure {
    patience: Duration,
    /// Number of the current send.
    send: AtomicU64,
    /// Receivers that did not take the sample of the current send.
    refused: AtomicU64,
    /// Number of the last send in which a receiver's stall timeout expired, by its port id.
    gave_out: Mutex<HashMap<u128, u64>>,
}

impl Backpressure {
    pub(super) fn new(patience: Duration) -> Self {
        Self {
            patience,
            send: AtomicU64::new(0),
            refused: AtomicU64::new(0),
            gave_out: Mutex::default(),
        }
    }

    /// Begins the next send.
    pub(super) fn begin(&self) {
        self.send.fetch_add(1, Ordering::Relaxed);
        self.refused.store(0, Ordering::Relaxed);
    }

    /// Number of receivers that did not take the sample of the current send.
    pub(super) fn refused(&self) -> usize {
        self.refused.load(Ordering::Relaxed) as usize
    }

    /// Decides between retry and discard for a receiver whose buffer is full. A receiver that did not take the
    /// previous sample either has read nothing in between, and the sender does not wait for it again.
    pub(super) fn decide(&self, info: &BackpressureInfo) -> BackpressureAction {
        let send = self.send.load(Ordering::Relaxed);
        let mut gave_out = self.gave_out.lock().unwrap_or_else(PoisonError::into_inner);
        let last = gave_out.get(&info.receiver_port_id).copied();
        let stuck = last.is_some_and(|last| last + 1 == send);
        if stuck || info.elapsed_time >= self.patience {
            // Drops the entries of disconnected receivers: only those of the previous send are ever read.
            gave_out.retain(|_, last| *last + 1 >= send);
            gave_out.insert(info.receiver_port_id, send);
            self.refused.fetch_add(1, Ordering::Relaxed);
            return BackpressureAction::DiscardData;
        }
        drop(gave_out);
        if info.retries >= YIELDS {
            std::thread::sleep(if info.elapsed_time < LONG_FROM {
                SHORT
            } else {
                LONG
            });
        }
        BackpressureAction::Retry
    }
}
