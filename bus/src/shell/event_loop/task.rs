//! A group in an event loop, from its start to its end.

use std::io;
use std::os::fd::OwnedFd;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use rustix::event::epoll;

use super::waker::TaskWaker;
use crate::link::POLL_TAKEN_EVERY;
use crate::shell::group::{Ends, Group, Next, Node, set_failed};
use crate::shell::heartbeat::Heartbeat;
use crate::shell::report::{Outcome, Report};
use crate::shell::{Context, REPORT_EVERY, TAKEN_WITHIN};
use crate::stage::StageError;

/// Interval at which a starting group looks for its receivers.
/// Resolution: delay of the start.
const CONNECT_EVERY: Duration = Duration::from_millis(20);
/// Largest number of turns of a group before the other groups have theirs.
/// Resolution: the delay of the other groups, against the cost of a round.
const TURNS: usize = 16;

/// A group that a loop is to run.
pub(in crate::shell) struct Task<'a> {
    /// The nodes of the group, each behind its inputs.
    pub nodes: Vec<(Node<'a>, Ends)>,
    /// Stop request, status board, name of the first stage.
    pub context: Context,
    /// Longest wait for receivers, after which the group starts without them.
    pub within: Duration,
    /// Called once for each stage when the group starts, with the number of receivers that are not connected.
    pub ready: fn(&str, usize),
    /// Called with the last reports.
    pub done: Box<dyn FnOnce(Vec<Report>) + Send + 'a>,
}

enum Phase {
    /// Waits for its receivers, until this time.
    Connecting(Instant),
    Running,
    /// Has ended its streams, and waits until they have been read.
    Draining,
}

pub(super) struct Running<'a> {
    pub token: u64,
    pub group: Group<'a>,
    context: Context,
    within: Duration,
    ready: fn(&str, usize),
    done: Box<dyn FnOnce(Vec<Report>) + Send + 'a>,
    phase: Phase,
    pub waker: Arc<TaskWaker>,
    next: Next,
    /// Time of the next report.
    report_at: Instant,
}

/// When a group is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Due {
    Now,
    At(Instant),
}

/// Result of a turn of a group.
pub(super) struct TurnResult {
    pub over: bool,
    /// Whether it has opened links with descriptors.
    pub has_descriptors: bool,
}

impl<'a> Running<'a> {
    /// Builds the group; `None` if its nodes do not fit each other.
    pub fn start(
        task: Task<'a>,
        token: u64,
        waker: Arc<TaskWaker>,
        heartbeat: &Heartbeat,
    ) -> Option<Self> {
        let Task {
            nodes,
            context,
            within,
            ready,
            done,
        } = task;
        let stages = nodes.iter().map(|(_, ends)| Report {
            stage: ends.stage.clone(),
            ..Report::default()
        });
        let mut reports: Vec<Report> = stages.collect();
        let mut group = Group::under(heartbeat.clone());
        for (node, ends) in nodes {
            let stage = ends.stage.clone();
            if let Err(error) = group.add(node, ends) {
                set_failed(&mut reports, &stage, &Outcome::of(&error.into()));
                context.board.post(&reports);
                done(reports);
                return None;
            }
        }
        let now = Instant::now();
        Some(Self {
            token,
            group,
            context,
            within,
            ready,
            done,
            phase: Phase::Connecting(now + within),
            waker,
            next: Next::Now,
            report_at: now,
        })
    }

    pub fn due(&self) -> Due {
        match self.next {
            Next::Now => Due::Now,
            Next::At(at) => Due::At(at.min(self.report_at)),
            Next::Woken | Next::Over => Due::At(self.report_at),
        }
    }

    pub fn is_due(&self, now: Instant) -> bool {
        self.waker.take()
            || match self.due() {
                Due::Now => true,
                Due::At(at) => at <= now,
            }
    }

    pub fn turn(&mut self, now: Instant, epoll: &OwnedFd) -> Result<TurnResult, StageError> {
        let stopped = self.context.stop.is_stopped();
        let mut has_descriptors = false;
        if now >= self.report_at {
            self.report_at = now + REPORT_EVERY;
            if matches!(self.phase, Phase::Running) {
                self.group.maintain(now)?;
                self.context.board.post(&self.group.reports());
            }
        }
        if let Phase::Connecting(until) = self.phase {
            let missing = self.group.missing_receivers()?;
            let is_there = missing.iter().all(|(_, missing)| *missing == 0);
            if !is_there && now < until && !stopped {
                self.next = Next::At(now + CONNECT_EVERY);
                return Ok(TurnResult {
                    over: false,
                    has_descriptors,
                });
            }
            for (stage, missing) in missing {
                let within = self.within;
                if missing > 0 && !stopped {
                    tracing::warn!(stage, missing, ?within, "receivers are not there");
                }
                (self.ready)(&stage, missing);
            }
            has_descriptors = self.open(epoll)?;
            self.phase = Phase::Running;
            self.context.board.follow(self.group.heartbeat());
            self.context.board.post(&self.group.reports());
        }
        if matches!(self.phase, Phase::Running) {
            for _ in 0..TURNS {
                self.next = self.group.turn(stopped)?;
                if self.next != Next::Now {
                    break;
                }
            }
            if self.next == Next::Over {
                self.context.board.ends();
                self.phase = Phase::Draining;
            }
        }
        let mut over = false;
        if matches!(self.phase, Phase::Draining) {
            over = self.group.poll_taken(TAKEN_WITHIN)?.is_ready();
            self.next = Next::At(now + POLL_TAKEN_EVERY);
        }
        Ok(TurnResult {
            over,
            has_descriptors,
        })
    }

    /// Opens the links of the group. Returns whether any of them has a descriptor.
    fn open(&mut self, epoll: &OwnedFd) -> Result<bool, StageError> {
        self.group.open()?;
        let waker = Arc::clone(&self.waker).into();
        let mut any = false;
        for descriptor in self.group.register(&waker) {
            let token = epoll::EventData::new_u64(self.token);
            // The system removes a descriptor that is closed.
            epoll::add(epoll, descriptor, token, epoll::EventFlags::IN)
                .map_err(|error| StageError::failed(io::Error::from(error)))?;
            any = true;
        }
        Ok(any)
    }

    /// Reports the end; `failure` is the stage that failed, with the reason.
    pub fn end(self, failure: Option<(String, Outcome)>) {
        let Self {
            group,
            context,
            done,
            ..
        } = self;
        let counted = catch_unwind(AssertUnwindSafe(|| group.reports()));
        let mut reports = counted.unwrap_or_else(|_| context.board.read());
        if let Some((stage, outcome)) = failure {
            set_failed(&mut reports, &stage, &outcome);
        }
        context.board.post(&reports);
        done(reports);
    }
}
