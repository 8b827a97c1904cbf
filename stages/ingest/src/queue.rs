//! Bounded queue of received messages. When it is full, the oldest message is dropped.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::Waker;

/// The queue between the receiving threads and the thread of the stage.
#[derive(Debug)]
pub(crate) struct Queue<T> {
    state: Mutex<State<T>>,
    capacity: usize,
}

#[derive(Debug)]
struct State<T> {
    messages: VecDeque<T>,
    overflowed: u64,
    /// Waker of the thread of the stage.
    waker: Option<Waker>,
}

impl<T> Queue<T> {
    pub fn new(capacity: usize) -> Self {
        Self {
            state: Mutex::new(State {
                messages: VecDeque::new(),
                overflowed: 0,
                waker: None,
            }),
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
        if let Some(waker) = &state.waker {
            waker.wake_by_ref();
        }
    }

    /// Wakes `waker` for every message from now on.
    pub fn register(&self, waker: &Waker) {
        self.lock().waker = Some(waker.clone());
    }

    /// Removes the oldest message.
    pub fn pop(&self) -> Option<T> {
        self.lock().messages.pop_front()
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
        let took: Vec<_> = std::iter::from_fn(|| queue.pop()).collect();
        assert_eq!(took, [2, 3, 4]);
        assert_eq!(queue.overflowed(), 2);
    }

    #[test]
    fn whoever_waits_is_woken() {
        struct Count(std::sync::atomic::AtomicUsize);
        impl std::task::Wake for Count {
            fn wake(self: std::sync::Arc<Self>) {
                self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            }
        }
        let count = std::sync::Arc::new(Count(0.into()));
        let queue = Queue::new(3);
        queue.register(&std::sync::Arc::clone(&count).into());
        queue.push(7);
        assert_eq!(count.0.load(std::sync::atomic::Ordering::Relaxed), 1);
        assert_eq!(queue.pop(), Some(7));
    }
}
