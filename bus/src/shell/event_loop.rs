//! An event loop: one thread that runs any number of stage groups.
//!
//! It sleeps until the first group has something to do: a moment for which a source waits, or a sample on a link. Then
//! it serves all groups that have something to do. Sources that are paced at the same rate share a wake-up. A group
//! that fails or panics ends, and the others continue.
//!
//! The loop is epoll(7) with a timeout in nanoseconds. The `WaitSet` of iceoryx2 borrows its listeners for as long as
//! it lives, so that receivers could not use them; the timer of tokio has a resolution of a millisecond.

mod task;
mod waker;

use std::io;
use std::os::fd::OwnedFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, epoll, poll};

use super::Context;
use super::group::{Ends, Node};
use super::heartbeat::Heartbeat;
use super::report::{Outcome, Report};

pub(super) use task::Task;

use task::{Due, Running};
use waker::{Notifier, TaskWaker};

/// Largest delay of a group for the sake of a common wake-up.
/// Resolution: half a sample at 1 kHz. Any number of paced cells need two wake-ups a millisecond.
const SLACK: Duration = Duration::from_micros(500);
/// Largest number of descriptors that one wait reports; the next wait reports the others.
/// Resolution: memory.
const EVENTS: usize = 64;
/// Token of the notifier among the descriptors.
const NOTIFIER: u64 = u64::MAX;

/// An event loop.
pub struct EventLoop<'a> {
    epoll: OwnedFd,
    notifier: Arc<Notifier>,
    /// Waker for a new task.
    arrival: Arc<TaskWaker>,
    heartbeat: Heartbeat,
    tasks: Vec<Running<'a>>,
    events: Vec<epoll::Event>,
    tokens: u64,
    /// Whether there are descriptors to look at.
    has_descriptors: bool,
}

impl<'a> EventLoop<'a> {
    /// A loop without groups.
    ///
    /// # Errors
    /// If the system has no more descriptors.
    pub fn new() -> io::Result<Self> {
        let epoll = epoll::create(epoll::CreateFlags::CLOEXEC)?;
        let notifier = Notifier::new()?;
        let token = epoll::EventData::new_u64(NOTIFIER);
        epoll::add(&epoll, &notifier.eventfd, token, epoll::EventFlags::IN)?;
        Ok(Self {
            epoll,
            arrival: TaskWaker::new(&notifier),
            notifier,
            heartbeat: Heartbeat::default(),
            tasks: Vec::new(),
            events: Vec::with_capacity(EVENTS),
            tokens: 0,
            has_descriptors: false,
        })
    }

    /// Wakes the loop for a new task; see [`EventLoop::run`].
    pub fn waker(&self) -> Waker {
        Arc::clone(&self.arrival).into()
    }

    /// Runs until all groups have ended and `arrivals` has no more. It is called at the start and after each wake-up
    /// by [`EventLoop::waker`], until it returns `Pending`, or `None` for ever.
    pub fn run(mut self, arrivals: &mut dyn FnMut() -> Poll<Option<Task<'a>>>) {
        let mut expects = true;
        self.arrival.set();
        loop {
            if expects && self.arrival.take() {
                expects = loop {
                    match arrivals() {
                        Poll::Ready(Some(task)) => self.start(task),
                        Poll::Ready(None) => break false,
                        Poll::Pending => break true,
                    }
                };
            }
            let now = Instant::now();
            self.serve(now);
            if self.tasks.is_empty() && !expects {
                return;
            }
            self.sleep(expects);
        }
    }

    fn start(&mut self, task: Task<'a>) {
        self.tokens += 1;
        let waker = TaskWaker::new(&self.notifier);
        if let Some(task) = Running::start(task, self.tokens, waker, &self.heartbeat) {
            self.tasks.push(task);
        }
    }

    /// Lets every group that has something to do make a turn.
    fn serve(&mut self, now: Instant) {
        for event in &self.events {
            let token = event.data.u64();
            if let Some(task) = self.tasks.iter().find(|task| task.token == token) {
                task.waker.set();
            }
        }
        self.events.clear();
        let mut over = Vec::new();
        for (index, task) in self.tasks.iter_mut().enumerate() {
            if !task.is_due(now) {
                continue;
            }
            let result = catch_unwind(AssertUnwindSafe(|| task.turn(now, &self.epoll)));
            let ended = match result {
                Ok(Ok(result)) => {
                    self.has_descriptors |= result.has_descriptors;
                    result.over.then_some(None)
                }
                Ok(Err(error)) => {
                    let (stage, error) = task.group.failure(error);
                    Some(Some((stage, Outcome::of(&error))))
                }
                Err(panic) => {
                    let words = format!("it panicked: {}", panic_message(&*panic));
                    Some(Some((task.group.current_stage(), Outcome::Failed(words))))
                }
            };
            if let Some(failure) = ended {
                over.push((index, failure));
            }
        }
        // The last first, so that the indices stay right.
        for (index, failure) in over.into_iter().rev() {
            self.tasks.remove(index).end(failure);
        }
    }

    /// Sleeps until a group has something to do.
    fn sleep(&mut self, expects: bool) {
        self.notifier.prepare_to_sleep();
        let is_woken =
            (expects && self.arrival.is_set()) || self.tasks.iter().any(|task| task.waker.is_set());
        let until = self.tasks.iter().map(Running::due).min();
        let now = Instant::now();
        let timeout = match until {
            _ if is_woken => Some(Duration::ZERO),
            Some(Due::Now) => Some(Duration::ZERO),
            Some(Due::At(at)) => Some((at + SLACK).saturating_duration_since(now)),
            None => None,
        };
        let is_ready = if timeout == Some(Duration::ZERO) {
            // A source that never waits needs no system call.
            self.has_descriptors
        } else {
            let timeout = timeout.map(|timeout| Timespec {
                tv_sec: timeout.as_secs().cast_signed(),
                tv_nsec: timeout.subsec_nanos().into(),
            });
            // poll(2) of the epoll descriptor, because epoll_wait(2) rounds its timeout up to a millisecond. A signal
            // may interrupt the wait; its handler has already run.
            let mut epoll = [PollFd::new(&self.epoll, PollFlags::IN)];
            poll(&mut epoll, timeout.as_ref()).is_ok_and(|ready| ready > 0)
        };
        self.notifier.set_awake();
        if is_ready {
            let room = rustix::buffer::spare_capacity(&mut self.events);
            let _ = epoll::wait(&self.epoll, room, Some(&Timespec::default()));
        }
        if self.events.iter().any(|event| event.data.u64() == NOTIFIER) {
            self.notifier.reset();
        }
    }
}

/// Runs one group to its end in this thread; see [`Task`].
///
/// # Errors
/// If the system has no more descriptors.
pub(super) fn run(
    context: &Context,
    within: Duration,
    ready: fn(&str, usize),
    nodes: Vec<(Node<'_>, Ends)>,
) -> io::Result<Vec<Report>> {
    let (ended, reports) = mpsc::channel();
    let mut task = Some(Task {
        nodes,
        context: context.clone(),
        within,
        ready,
        done: Box::new(move |reports| {
            // The receiver lives as long as the loop.
            let _ = ended.send(reports);
        }),
    });
    EventLoop::new()?.run(&mut || Poll::Ready(task.take()));
    Ok(reports.try_recv().unwrap_or_default())
}

/// Message of a panic.
pub(super) fn panic_message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests;
