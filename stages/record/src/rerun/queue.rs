//! Bounded queue for a live viewer, which drops the oldest items.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Counters of the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Counts {
    /// Number of items pushed.
    pub pushed: u64,
    /// Number of items dropped in favour of newer ones.
    pub dropped: u64,
}

/// Result of a pop.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Next<T> {
    /// The oldest item.
    Item(T),
    /// No item within the timeout.
    Nothing,
    /// No item, and the queue is closed.
    Closed,
}

#[derive(Debug)]
struct State<T> {
    items: VecDeque<T>,
    counts: Counts,
    closed: bool,
    finished: bool,
}

/// A queue of at most `capacity` items between a writer that never blocks and a reader that may block.
#[derive(Debug)]
pub(super) struct NewestQueue<T> {
    capacity: usize,
    state: Mutex<State<T>>,
    changed: Condvar,
}

impl<T> NewestQueue<T> {
    pub fn new(capacity: usize) -> Self {
        let items = VecDeque::with_capacity(capacity);
        let state = State {
            items,
            counts: Counts::default(),
            closed: false,
            finished: false,
        };
        Self {
            capacity,
            state: Mutex::new(state),
            changed: Condvar::new(),
        }
    }

    /// Pushes an item; a full queue drops its oldest item.
    pub fn push(&self, item: T) {
        let mut state = self.lock();
        if state.items.len() == self.capacity {
            state.items.pop_front();
            state.counts.dropped += 1;
        }
        state.items.push_back(item);
        state.counts.pushed += 1;
        self.changed.notify_all();
    }

    /// Pops the oldest item; waits at most `timeout` for one.
    pub fn pop(&self, timeout: Duration) -> Next<T> {
        let mut state = self.wait(timeout, |state| state.items.is_empty() && !state.closed);
        match state.items.pop_front() {
            Some(item) => Next::Item(item),
            None if state.closed => Next::Closed,
            None => Next::Nothing,
        }
    }

    /// Closes the queue after the writer's last item.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Waits at most `timeout` for the queue to be closed; returns whether it is.
    pub fn wait_closed(&self, timeout: Duration) -> bool {
        self.wait(timeout, |state| !state.closed).closed
    }

    /// Marks the reader as finished.
    pub fn finish(&self) {
        self.lock().finished = true;
        self.changed.notify_all();
    }

    /// Waits at most `timeout` for the reader to finish; returns whether it has.
    pub fn wait_finished(&self, timeout: Duration) -> bool {
        self.wait(timeout, |state| !state.finished).finished
    }

    /// Returns the counters; items left after the reader has finished count as dropped.
    pub fn counts(&self) -> Counts {
        let state = self.lock();
        let left = if state.finished {
            state.items.len() as u64
        } else {
            0
        };
        Counts {
            dropped: state.counts.dropped + left,
            ..state.counts
        }
    }

    fn wait(
        &self,
        timeout: Duration,
        mut blocked: impl FnMut(&State<T>) -> bool,
    ) -> MutexGuard<'_, State<T>> {
        let end = Instant::now() + timeout;
        let mut state = self.lock();
        while blocked(&state) {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            state = self
                .changed
                .wait_timeout(state, left)
                .map_or_else(|poisoned| poisoned.into_inner().0, |(state, _)| state);
        }
        state
    }

    /// Locks the state. A poisoned lock is harmless, because no update is left half done.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    const NO_TIME: Duration = Duration::ZERO;
    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn the_newest_win_and_what_gave_way_is_counted() {
        let queue = NewestQueue::new(3);
        (0..10).for_each(|item| queue.push(item));
        assert_eq!(
            queue.counts(),
            Counts {
                pushed: 10,
                dropped: 7
            }
        );
        queue.close();
        let taken: Vec<_> = (0..4).map(|_| queue.pop(NO_TIME)).collect();
        assert_eq!(
            taken,
            [Next::Item(7), Next::Item(8), Next::Item(9), Next::Closed]
        );
    }

    #[test]
    fn a_queue_of_a_million_items_holds_no_more_than_its_capacity() {
        let queue = NewestQueue::new(4);
        (0..1_000_000).for_each(|item| queue.push(item));
        assert_eq!(queue.lock().items.len(), 4);
        assert_eq!(queue.lock().items.capacity(), 4);
    }

    #[test]
    fn the_reader_waits_for_an_item_and_not_for_ever() {
        let queue = Arc::new(NewestQueue::new(4));
        assert_eq!(queue.pop(NO_TIME), Next::Nothing);
        let writer = {
            let queue = Arc::clone(&queue);
            std::thread::spawn(move || queue.push(1))
        };
        assert_eq!(queue.pop(LONG), Next::Item(1));
        writer.join().unwrap();
    }

    #[test]
    fn the_writer_waits_for_the_reader_and_not_for_ever() {
        let queue = Arc::new(NewestQueue::new(4));
        queue.push(1);
        assert!(!queue.wait_finished(NO_TIME));
        let reader = {
            let queue = Arc::clone(&queue);
            std::thread::spawn(move || queue.finish())
        };
        assert!(queue.wait_finished(LONG));
        assert_eq!(
            queue.counts(),
            Counts {
                pushed: 1,
                dropped: 1
            }
        );
        reader.join().unwrap();
    }
}
