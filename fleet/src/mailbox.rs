//! The bounded queue of the hub. Liveliness tokens and user actions are urgent, so other messages do not delay them.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of items of each class.
/// Resolution: five statuses of a thousand cells.
const MAX_WAITING: usize = 8192;

/// A queue with an urgent and an ordinary class.
#[derive(Debug)]
pub struct Mailbox<T> {
    queues: Mutex<Queues<T>>,
    arrived: Condvar,
}

#[derive(Debug)]
struct Queues<T> {
    urgent: VecDeque<T>,
    ordinary: VecDeque<T>,
    overflowed: u64,
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self {
            queues: Mutex::new(Queues {
                urgent: VecDeque::new(),
                ordinary: VecDeque::new(),
                overflowed: 0,
            }),
            arrived: Condvar::new(),
        }
    }
}

impl<T> Mailbox<T> {
    /// Adds an urgent item.
    pub fn urgent(&self, item: T) {
        self.put(item, |queues| &mut queues.urgent);
    }

    /// Adds an ordinary item.
    pub fn ordinary(&self, item: T) {
        self.put(item, |queues| &mut queues.ordinary);
    }

    fn put(&self, item: T, queue: fn(&mut Queues<T>) -> &mut VecDeque<T>) {
        let mut queues = self.lock();
        if queue(&mut queues).len() >= MAX_WAITING {
            queues.overflowed += 1;
            return;
        }
        queue(&mut queues).push_back(item);
        drop(queues);
        self.arrived.notify_one();
    }

    /// Waits at most `patience` for items. Returns all items, urgent ones first, and the number dropped since the
    /// last call.
    pub fn take(&self, patience: Duration) -> (Vec<T>, u64) {
        let queues = self.lock();
        let empty = |queues: &mut Queues<T>| queues.urgent.is_empty() && queues.ordinary.is_empty();
        let waited = self.arrived.wait_timeout_while(queues, patience, empty);
        let (mut queues, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let overflowed = std::mem::take(&mut queues.overflowed);
        let mut all: Vec<T> = queues.urgent.drain(..).collect();
        all.extend(queues.ordinary.drain(..));
        (all, overflowed)
    }

    // Each queue is consistent at any time, so a poisoned lock is harmless.
    fn lock(&self) -> MutexGuard<'_, Queues<T>> {
        self.queues.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_bounded_and_does_not_hold_up_what_is_urgent() {
        let mailbox = Mailbox::default();
        for n in 0..MAX_WAITING + 3 {
            mailbox.ordinary(n);
        }
        mailbox.urgent(usize::MAX);
        let (all, overflowed) = mailbox.take(Duration::ZERO);
        assert_eq!(
            (all[0], all.len(), overflowed),
            (usize::MAX, MAX_WAITING + 1, 3)
        );
        assert_eq!(mailbox.take(Duration::ZERO), (vec![], 0));
    }
}
