//! How long a sender waits for a receiver whose buffer is full.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use iceoryx2::port::{BackpressureAction, BackpressureInfo};

/// Number of first tries, which iceoryx2 spends yielding.
/// Resolution: the delay of a sample, against computing time.
const YIELDS: u64 = 20;
/// Wait after each further try.
/// Resolution: the delay of a sample, against computing time.
const SHORT: Duration = Duration::from_micros(50);
/// Wait after each try from [`LONG_FROM`] on.
/// Resolution: the delay of a sample, against computing time.
const LONG: Duration = Duration::from_millis(1);
/// The long wait begins this long after the first try.
/// Resolution: the delay of a sample, against computing time.
const LONG_FROM: Duration = Duration::from_millis(100);

/// Shared by a sender and the handler that iceoryx2 calls while it waits within a send.
#[derive(Debug)]
pub(super) struct Backpressure {
    patience: Duration,
    /// Number of the present send.
    send: AtomicU64,
    /// Refusals of the present send.
    refused: AtomicU64,
    /// The last send that a receiver's patience ran out in, by its port.
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

    /// A send begins.
    pub(super) fn begin(&self) {
        self.send.fetch_add(1, Ordering::Relaxed);
        self.refused.store(0, Ordering::Relaxed);
    }

    /// How many receivers have refused the sample of the present send.
    pub(super) fn refused(&self) -> usize {
        self.refused.load(Ordering::Relaxed) as usize
    }

    /// A receiver's buffer is full. One that refused the sample before this one as well has taken
    /// nothing in between, and is not waited for again.
    pub(super) fn decide(&self, info: &BackpressureInfo) -> BackpressureAction {
        let send = self.send.load(Ordering::Relaxed);
        let mut gave_out = self.gave_out.lock().unwrap_or_else(PoisonError::into_inner);
        let last = gave_out.get(&info.receiver_port_id).copied();
        let stuck = last.is_some_and(|last| last + 1 == send);
        if stuck || info.elapsed_time >= self.patience {
            // Receivers that have gone leave an entry; few ever do, and old ones say nothing.
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
