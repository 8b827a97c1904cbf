//! A bounded queue between threads, with either overflow policy.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::task::Waker;
use std::time::{Duration, Instant};

use super::{Keep, Position};

/// A queued payload with its position in the sender's stream.
#[derive(Debug)]
pub(crate) struct Message<P> {
    /// Session epoch of the sender.
    pub(crate) instance: u64,
    /// Sequence number within the session.
    pub(crate) sequence: u64,
    pub(crate) payload: P,
}

/// Result of [`Queue::push`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pushed {
    /// The entry is in the queue.
    Taken,
    /// The reader took nothing within the stall timeout; the entry is discarded.
    GaveOut,
    /// The reader has closed the queue.
    Closed,
}

#[derive(Debug)]
pub(crate) struct Queue<P> {
    keep: Keep,
    depth: usize,
    state: Mutex<State<P>>,
    filled: Condvar,
    emptied: Condvar,
}

#[derive(Debug)]
struct State<P> {
    entries: VecDeque<Message<P>>,
    /// Position at which this reader connected: that of the first entry pushed, whether taken or discarded.
    begin: Option<Position>,
    closed: bool,
    /// The stall timeout has expired and the reader has taken nothing since.
    stuck: bool,
    /// Numbers of sleeping readers and writers. They change under the lock, so no wake-up is missed although a
    /// notification, which costs a system call, is sent only to a sleeper.
    sleeping: Sleeping,
    /// Waker of an event loop that reads the queue.
    waker: Option<Waker>,
}

#[derive(Debug, Default)]
struct Sleeping {
    readers: usize,
    writers: usize,
}

impl<P> Queue<P> {
    pub(crate) fn new(keep: Keep, depth: usize) -> Self {
        Self {
            keep,
            depth,
            state: Mutex::new(State {
                // One more than `depth`: `push_over` appends the end of a stream to a full queue.
                entries: VecDeque::with_capacity(depth + 1),
                begin: None,
                closed: false,
                stuck: false,
                sleeping: Sleeping::default(),
                waker: None,
            }),
            filled: Condvar::new(),
            emptied: Condvar::new(),
        }
    }

    pub(crate) fn keep(&self) -> Keep {
        self.keep
    }

    /// Appends `entry`. Under [`Keep::All`], waits at most `patience` for a free slot.
    pub(crate) fn push(&self, entry: Message<P>, patience: Duration) -> Pushed {
        let mut state = self.lock();
        state.begin.get_or_insert(Position {
            instance: entry.instance,
            next: entry.sequence,
        });
        // A hung reader costs its writer one timeout, not one per sample.
        if self.keep == Keep::All && !state.stuck {
            let full = |s: &mut State<P>| s.entries.len() >= self.depth && !s.closed;
            if full(&mut state) {
                state.sleeping.writers += 1;
                state = self
                    .emptied
                    .wait_timeout_while(state, patience, full)
                    .unwrap_or_else(PoisonError::into_inner)
                    .0;
                state.sleeping.writers -= 1;
            }
        }
        if state.closed {
            return Pushed::Closed;
        }
        if state.entries.len() >= self.depth {
            if self.keep == Keep::All {
                state.stuck = true;
                return Pushed::GaveOut;
            }
            state.entries.pop_front();
        }
        self.append(state, entry);
        Pushed::Taken
    }

    /// Appends `entry` even if the queue is full: for the end of a stream, once.
    pub(crate) fn push_over(&self, entry: Message<P>) {
        let state = self.lock();
        if !state.closed {
            self.append(state, entry);
        }
    }

    fn append(&self, mut state: MutexGuard<'_, State<P>>, entry: Message<P>) {
        state.entries.push_back(entry);
        let wake = state.sleeping.readers > 0;
        if let Some(waker) = &state.waker {
            waker.wake_by_ref();
        }
        drop(state);
        if wake {
            self.filled.notify_one();
        }
    }

    /// Wakes `waker` for every entry from now on.
    pub(crate) fn register(&self, waker: &Waker) {
        self.lock().waker = Some(waker.clone());
    }

    /// Takes the oldest entry, waiting at most `timeout` for one.
    pub(crate) fn pop(&self, timeout: Duration) -> Option<Message<P>> {
        let deadline = Instant::now() + timeout;
        let mut state = self.lock();
        loop {
            if let Some(entry) = state.entries.pop_front() {
                state.stuck = false;
                let wake = state.sleeping.writers > 0;
                drop(state);
                if wake {
                    self.emptied.notify_one();
                }
                return Some(entry);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            state.sleeping.readers += 1;
            state = self
                .filled
                .wait_timeout(state, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
            state.sleeping.readers -= 1;
        }
    }

    /// Position at which this reader connected, if anything has been pushed.
    pub(crate) fn begin(&self) -> Option<Position> {
        self.lock().begin
    }

    /// Closes the queue when the reader disconnects: further entries are rejected, and a waiting writer returns.
    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.emptied.notify_all();
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.lock().closed
    }

    // No code panics while it holds the lock, so a poisoned one still guards a consistent state.
    fn lock(&self) -> MutexGuard<'_, State<P>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::ZERO;

    fn message(sequence: u64) -> Message<()> {
        Message {
            instance: 7,
            sequence,
            payload: (),
        }
    }

    fn pop(queue: &Queue<()>) -> Option<u64> {
        queue.pop(NOW).map(|message| message.sequence)
    }

    #[test]
    fn the_oldest_gives_way_and_the_beginning_is_remembered() {
        let queue = Queue::new(Keep::Newest, 2);
        for sequence in 3..8 {
            assert_eq!(queue.push(message(sequence), NOW), Pushed::Taken);
        }
        assert_eq!(
            (pop(&queue), pop(&queue), pop(&queue)),
            (Some(6), Some(7), None)
        );
        assert_eq!(queue.begin().unwrap().next, 3);
    }

    #[test]
    fn a_stuck_reader_uses_up_the_patience_once() {
        let patience = Duration::from_millis(20);
        let queue = Queue::new(Keep::All, 1);
        assert_eq!(queue.push(message(0), patience), Pushed::Taken);
        let begin = Instant::now();
        assert_eq!(queue.push(message(1), patience), Pushed::GaveOut);
        assert!(begin.elapsed() >= patience);
        let minute = Duration::from_mins(1);
        assert_eq!(queue.push(message(2), minute), Pushed::GaveOut);
        assert!(begin.elapsed() < minute, "it does not wait again");
        assert_eq!(pop(&queue), Some(0));
        assert_eq!(queue.push(message(3), patience), Pushed::Taken);
        assert_eq!(pop(&queue), Some(3));
    }

    #[test]
    fn the_end_has_room_in_a_full_queue() {
        let queue = Queue::new(Keep::All, 1);
        queue.push(message(0), NOW);
        queue.push_over(message(1));
        assert_eq!((pop(&queue), pop(&queue)), (Some(0), Some(1)));
    }

    #[test]
    fn who_sleeps_is_woken() {
        let (begin, minute) = (Instant::now(), Duration::from_mins(1));
        let queue = Queue::new(Keep::All, 1);
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| queue.pop(minute).map(|message| message.sequence));
            while queue.lock().sleeping.readers == 0 {
                std::thread::yield_now();
            }
            queue.push(message(0), NOW);
            assert_eq!(reader.join().unwrap(), Some(0));
            queue.push(message(1), NOW);
            let writer = scope.spawn(|| queue.push(message(2), minute));
            while queue.lock().sleeping.writers == 0 {
                std::thread::yield_now();
            }
            assert_eq!(pop(&queue), Some(1));
            assert_eq!(writer.join().unwrap(), Pushed::Taken);
        });
        assert!(begin.elapsed() < minute);
    }

    #[test]
    fn a_reader_that_leaves_lets_the_writer_go() {
        let queue = Queue::new(Keep::All, 1);
        queue.push(message(0), NOW);
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| queue.push(message(1), Duration::from_mins(1)));
            queue.close();
            assert_eq!(writer.join().unwrap(), Pushed::Closed);
        });
    }
}
