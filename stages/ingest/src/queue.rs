//! Bounded queue of received messages. When it is full, the oldest message is dropped.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The queue between the receiving threads and the thread of the stage.
#[derive(Debug)]
pub(crate) struct Queue<T> {
    state: Mutex<State<T>>,
    filled: Condvar,
    capacity: usize,
}

#[derive(Debug)]
struct State<T> {
    messages: VecDeque<T>,
    overflowed: u64,
}

impl<T> Queue<T> {
    pub fn new(capacity: usize) -> Self {
        Self {
            state: Mutex::new(State {
                messages: VecDeque::new(),
                overflowed: 0,
            }),
            filled: Condvar::new(),
            capacity: capacity.max(1),
        }
    }

    /// Adds a message without blocking.
    pub fn push(&self, message: T) {
        let mut state = self.lock();
        if state.messages.len() >= self.capacity {
            state.messages.pop_front();
            state.overflowed += 1;
        }
        state.messages.push_back(message);
        drop(state);
        self.filled.notify_one();
    }

    /// Removes the oldest message; waits at most `patience` for one.
    pub fn pop(&self, patience: Duration) -> Option<T> {
        let state = self.lock();
        let empty = |state: &mut State<T>| state.messages.is_empty();
        let (mut state, _) = self
            .filled
            .wait_timeout_while(state, patience, empty)
            .unwrap_or_else(PoisonError::into_inner);
        state.messages.pop_front()
    }

    /// Returns the number of dropped messages.
    pub fn overflowed(&self) -> u64 {
        self.lock().overflowed
    }

    /// Locks the queue, even if poisoned: no operation on it can be left half done.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_gives_way_and_is_counted() {
        let queue = Queue::new(3);
        for i in 0..5 {
            queue.push(i);
        }
        let took: Vec<_> = std::iter::from_fn(|| queue.pop(Duration::ZERO)).collect();
        assert_eq!(took, [2, 3, 4]);
        assert_eq!(queue.overflowed(), 2);
    }

    #[test]
    fn whoever_waits_is_woken() {
        let queue = std::sync::Arc::new(Queue::new(3));
        let other = std::sync::Arc::clone(&queue);
        let waiter = std::thread::spawn(move || other.pop(Duration::from_secs(10)));
        queue.push(7);
        assert_eq!(waiter.join().unwrap(), Some(7));
    }
}
