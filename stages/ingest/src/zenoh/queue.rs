//! Messages that wait for the pipeline, at most so many: the oldest gives way.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use zenoh::bytes::ZBytes;
use zenoh::key_expr::KeyExpr;

use super::attachment::Attachment;

/// Which part of a sample a message brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    State,
    Command,
    Reference,
    Tool,
    Learn,
}

/// A message as it came.
#[derive(Debug)]
pub(super) struct Waiting {
    pub role: Role,
    pub received_ns: i64,
    pub key: KeyExpr<'static>,
    pub payload: ZBytes,
    pub attachment: Option<Attachment>,
}

/// The queue between Zenoh's threads and the stage's.
#[derive(Debug)]
pub(super) struct Queue {
    state: Mutex<State>,
    filled: Condvar,
    capacity: usize,
}

#[derive(Debug)]
struct State {
    messages: VecDeque<Waiting>,
    overflowed: u64,
}

impl Queue {
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

    /// Adds a message and never waits.
    pub fn push(&self, message: Waiting) {
        let mut state = self.lock();
        if state.messages.len() >= self.capacity {
            state.messages.pop_front();
            state.overflowed += 1;
        }
        state.messages.push_back(message);
        drop(state);
        self.filled.notify_one();
    }

    /// Takes the oldest message, waiting at most `patience` for one.
    pub fn pop(&self, patience: Duration) -> Option<Waiting> {
        let state = self.lock();
        let empty = |state: &mut State| state.messages.is_empty();
        let (mut state, _) = self
            .filled
            .wait_timeout_while(state, patience, empty)
            .unwrap_or_else(PoisonError::into_inner);
        state.messages.pop_front()
    }

    /// Messages that gave way.
    pub fn overflowed(&self) -> u64 {
        self.lock().overflowed
    }

    /// Nothing in here can be left half done, so a panic elsewhere does not matter.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(received_ns: i64) -> Waiting {
        Waiting {
            role: Role::State,
            received_ns,
            key: KeyExpr::try_from("a/b").unwrap().into_owned(),
            payload: ZBytes::default(),
            attachment: None,
        }
    }

    #[test]
    fn the_oldest_gives_way_and_is_counted() {
        let queue = Queue::new(3);
        for i in 0..5 {
            queue.push(message(i));
        }
        let took: Vec<_> = std::iter::from_fn(|| queue.pop(Duration::ZERO))
            .map(|message| message.received_ns)
            .collect();
        assert_eq!(took, [2, 3, 4]);
        assert_eq!(queue.overflowed(), 2);
    }

    #[test]
    fn whoever_waits_is_woken() {
        let queue = std::sync::Arc::new(Queue::new(3));
        let other = std::sync::Arc::clone(&queue);
        let waiter = std::thread::spawn(move || other.pop(Duration::from_secs(10)));
        queue.push(message(7));
        assert_eq!(waiter.join().unwrap().unwrap().received_ns, 7);
    }
}
