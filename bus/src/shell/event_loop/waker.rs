//! Wake-ups of a loop by other threads.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Wake;

use rustix::event::{EventfdFlags, eventfd};

/// Wakes a sleeping loop.
#[derive(Debug)]
pub(super) struct Notifier {
    pub eventfd: OwnedFd,
    /// Whether the loop sleeps, or is about to. The notifier is rung only then, because that is a system call.
    asleep: AtomicBool,
}

impl Notifier {
    pub fn new() -> io::Result<Arc<Self>> {
        let flags = EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK;
        Ok(Arc::new(Self {
            eventfd: eventfd(0, flags)?,
            asleep: AtomicBool::new(false),
        }))
    }

    /// Announces that the loop is about to sleep. It must look at its alarms once more after that.
    pub fn prepare_to_sleep(&self) {
        self.asleep.store(true, Ordering::SeqCst);
    }

    pub fn set_awake(&self) {
        self.asleep.store(false, Ordering::SeqCst);
    }

    /// Resets the descriptor after a wake-up.
    pub fn reset(&self) {
        let mut count = [0; 8];
        // Nothing to read: another wake-up was read with this one.
        let _ = rustix::io::read(&self.eventfd, &mut count);
    }
}

/// Waker of one group.
#[derive(Debug)]
pub(super) struct TaskWaker {
    woken: AtomicBool,
    notifier: Arc<Notifier>,
}

impl TaskWaker {
    pub fn new(notifier: &Arc<Notifier>) -> Arc<Self> {
        Arc::new(Self {
            woken: AtomicBool::new(false),
            notifier: Arc::clone(notifier),
        })
    }

    /// Sets it from the thread of the loop.
    pub fn set(&self) {
        self.woken.store(true, Ordering::SeqCst);
    }

    pub fn is_set(&self) -> bool {
        self.woken.load(Ordering::SeqCst)
    }

    /// Resets it, and returns whether it was set.
    pub fn take(&self) -> bool {
        self.is_set() && self.woken.swap(false, Ordering::SeqCst)
    }
}

impl Wake for TaskWaker {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.set();
        if self.notifier.asleep.swap(false, Ordering::SeqCst) {
            // A counter that is full wakes the loop, too.
            let _ = rustix::io::write(&self.notifier.eventfd, &1_u64.to_ne_bytes());
        }
    }
}
