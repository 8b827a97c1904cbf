//! One stage of this host, over all its incarnations.

use std::process::ExitStatus;
use std::time::Duration;

use tauscope_bus::shell::{Line, Outcome, Report};
use tauscope_bus::{SampleKind, Seat, Trouble};
use tauscope_pipeline::pipeline::{Restart, When};
use tokio::time::Instant;

use super::exit_words;
use super::flow::Flow;
use super::ledger::Kept;
use super::patience::{Overdue, Patience};
use super::reported::Reported;
use super::restart::Deaths;
use super::silence::Silence;
use super::tally::Tally;

/// A stage of this host.
#[derive(Debug)]
pub struct Local {
    /// Index in the pipeline.
    pub at: usize,
    /// Assignment that its process receives.
    pub seat: Seat,
    /// Its worker process, as an index into those of this host.
    pub worker: usize,
    /// Root of its group, as an index into the stages of this host. A group starts, ends and fails together.
    pub root: usize,
    /// Counts over all incarnations.
    pub tally: Tally,
    state: State,
    deaths: Deaths,
    /// Restart policy; that of a group is at its root.
    policy: Option<Restart>,
    heartbeat: Heartbeat,
    /// Whether this is the last incarnation.
    last_life: bool,
    /// Whether this incarnation is ready.
    ready: bool,
    /// Flow of its samples.
    pub flow: Flow,
    /// Current condition in a word or two, such as `muted`; empty if there is none.
    pub holds: String,
    /// Reports on missing samples.
    pub silence: Silence,
    /// Wait for its end, once it was asked to end.
    patience: Option<Patience>,
    /// Whether it was killed because it did not end.
    killed: bool,
    /// Time by which it should end by itself.
    finish_by: Option<Instant>,
    /// Counts that survive its death; without them, its last report is used.
    kept: Option<Kept>,
}

/// Heartbeat of this incarnation.
#[derive(Debug, Default)]
struct Heartbeat {
    /// Time of the last heartbeat.
    heard: Option<Instant>,
    /// Whether its process has reported since then that this stage blocks its thread.
    stuck: bool,
    /// Whether it has been reported as hung.
    hangs: bool,
}

#[derive(Debug)]
enum State {
    /// Running.
    Running,
    /// To be started at this time, for the first time or again.
    Waiting(Instant),
    /// Ended normally.
    Ended,
    /// Failed, and not restarted.
    Lost,
}

impl Local {
    /// Creates a stage that is to be started.
    pub fn new(at: usize, mut seat: Seat, worker: usize, root: usize) -> Self {
        let now = Instant::now();
        let kept = Kept::new(seat.inputs.len()).ok();
        seat.ledger = kept.as_ref().map(Kept::path);
        Self {
            at,
            seat,
            worker,
            root,
            tally: Tally::default(),
            state: State::Waiting(now),
            deaths: Deaths::default(),
            policy: None,
            heartbeat: Heartbeat::default(),
            last_life: false,
            ready: false,
            flow: Flow::new(now.into_std()),
            holds: String::new(),
            silence: Silence::default(),
            patience: None,
            killed: false,
            finish_by: None,
            kept,
        }
    }

    /// Returns whether it has no inputs.
    pub fn is_source(&self) -> bool {
        self.seat.inputs.is_empty()
    }

    /// Returns whether it runs and is ready.
    pub fn is_ready(&self) -> bool {
        self.ready && self.is_running()
    }

    /// Returns whether it was killed because it did not end.
    pub fn was_killed(&self) -> bool {
        self.killed
    }

    /// Returns the reason why it emits nothing usable, as it reports itself.
    pub fn trouble(&self) -> Option<&Trouble> {
        self.tally.newest().trouble.as_ref()
    }

    /// Returns whether its process was asked to run it, and it has not ended.
    pub fn is_running(&self) -> bool {
        matches!(self.state, State::Running)
    }

    /// Returns whether this incarnation has reported its end.
    pub fn is_done(&self) -> bool {
        self.tally.newest().outcome.is_some()
    }

    /// Notes that its process was asked to run it.
    pub fn started(&mut self) {
        self.state = State::Running;
        self.ready = false;
        self.holds.clear();
        self.heartbeat = Heartbeat::default();
        self.patience = None;
    }

    /// Gives it up: it is not started again.
    pub fn give_up(&mut self) {
        self.state = State::Lost;
    }

    /// Returns whether it has ended for good.
    pub fn is_over(&self) -> bool {
        matches!(self.state, State::Ended | State::Lost)
    }

    /// Returns whether it failed and was not restarted.
    pub fn is_lost(&self) -> bool {
        matches!(self.state, State::Lost)
    }

    /// Returns whether it is to be started.
    pub fn is_waiting(&self) -> bool {
        matches!(self.state, State::Waiting(_))
    }

    /// Returns the time of the next action on it: its start, or a request to end.
    pub fn due(&self) -> Option<Instant> {
        match self.state {
            State::Waiting(at) => Some(at),
            State::Running if self.patience.is_none() => self.finish_by,
            _ => None,
        }
    }

    /// Returns the progress of a source of known length, from 0 to 1.
    pub fn fraction_done(&self) -> Option<f64> {
        self.tally.newest().fraction_done
    }

    /// Handles a line of its standard output, and returns its meaning.
    pub fn report<'a>(&mut self, line: &'a str) -> Reported<'a> {
        match serde_json::from_str(line) {
            Ok(Line::Ready { missing, .. }) => {
                self.ready = true;
                return Reported::Ready { missing };
            }
            Ok(Line::Report(report) | Line::Done(report)) => self.tally.note(report),
            Ok(Line::Note { text, .. }) => return Reported::Note(text),
            Ok(Line::Holds { text, .. }) => {
                self.holds = text;
                return Reported::Holds;
            }
            Ok(Line::Stuck { .. }) => {
                self.heartbeat.stuck = true;
                return Reported::Stuck;
            }
            Err(_) => return Reported::Other(line),
        }
        let now = Instant::now();
        self.heartbeat.heard = Some(now);
        self.heartbeat.stuck = false;
        let moved = self.flow.note(self.samples(), now.into_std());
        if let Some(patience) = self.patience.as_mut().filter(|_| moved) {
            patience.extend(now);
        }
        Reported::Counts
    }

    /// Returns the number of received samples; for a source, of emitted ones.
    fn samples(&self) -> u64 {
        let sums = self.tally.sums();
        if self.is_source() {
            return sums.emitted;
        }
        let inputs = self.seat.inputs.iter().zip(&sums.inputs);
        let data = inputs.filter(|(input, _)| input.kind != SampleKind::Health);
        data.map(|(_, counts)| counts.received).sum()
    }

    /// Describes its failure, if it has failed; `exit` is the exit status of its process, if that has exited.
    pub fn death(&self, exit: Option<&std::io::Result<ExitStatus>>) -> Option<String> {
        let outcome = self.tally.newest().outcome.as_ref();
        let failed = outcome.and_then(Outcome::failure);
        if self.killed {
            return Some("did not end when asked to, was killed".to_owned());
        }
        match (failed, exit) {
            (Some(why), _) => Some(format!("{FAILED}: {why}")),
            (None, None) => None,
            (None, Some(Ok(status))) => Some(exit_words::of(*status)),
            (None, Some(Err(error))) => Some(format!("cannot be waited for: {error}")),
        }
    }

    /// Returns whether it reports that it ended because another stage of its group did.
    pub fn fell_with_another(&self) -> bool {
        let outcome = self.tally.newest().outcome.as_ref();
        outcome.is_some_and(Outcome::is_of_another)
    }

    /// Returns whether a restart may help. It does not help a stage that reports why it cannot start, or that its
    /// input is not the one it was made for.
    pub fn may_return(&self) -> bool {
        let outcome = self.tally.newest().outcome.as_ref();
        let is_unfit = matches!(outcome, Some(Outcome::Unfit(_)));
        let can_begin = (self.ready || outcome.is_none()) && !is_unfit;
        can_begin && !self.last_life && self.patience.is_none()
    }

    /// Notes a failure of its group; returns the delay before the restart, or `None` if there is none.
    pub fn note_death(&mut self) -> Option<Duration> {
        let policy = self.policy.unwrap_or_default();
        self.deaths.note(&policy, std::time::Instant::now())
    }

    /// Adds the restart policy of a stage of its group; the strictest applies.
    pub fn restart_by(&mut self, policy: Restart) {
        let policy = self.policy.map_or(policy, |own| own.strictest(policy));
        self.policy = Some(policy);
    }

    /// Returns whether it is restarted even after a normal end.
    pub fn returns_always(&self) -> bool {
        let always = self
            .policy
            .is_some_and(|policy| policy.when == When::Always);
        always && !self.last_life && self.patience.is_none()
    }

    /// Returns the time since its last heartbeat, which a running stage sends ten times per second. `None` before the
    /// first heartbeat of an incarnation: the stage waits for others, or sends none.
    pub fn unheard_for(&self, now: Instant) -> Option<Duration> {
        let heard = self
            .heartbeat
            .heard
            .filter(|_| self.is_running() && !self.is_done());
        heard.map(|heard| now.duration_since(heard))
    }

    /// Returns whether it blocks its thread, as its process reports.
    pub fn is_stuck(&self) -> bool {
        self.heartbeat.stuck
    }

    /// Sets whether it is hung; returns whether that has changed.
    pub fn note_hangs(&mut self, hangs: bool) -> bool {
        std::mem::replace(&mut self.heartbeat.hangs, hangs) != hangs
    }

    /// Returns whether it was last noted as hung.
    pub fn hangs(&self) -> bool {
        self.heartbeat.hangs
    }

    /// Notes its normal end.
    pub fn end(&mut self) {
        self.state = State::Ended;
    }

    /// Notes its failure; `again` is the delay before its restart, if there is one.
    pub fn die(&mut self, again: Option<Duration>) {
        self.settle();
        self.state = match again {
            Some(wait) => {
                self.next_life();
                State::Waiting(Instant::now() + wait)
            }
            None => State::Lost,
        };
    }

    /// Adds the counts since its last report, and clears them for the next incarnation. A stage that has reported its
    /// end has reported all of them.
    fn settle(&mut self) {
        let Some(kept) = &self.kept else { return };
        if let (false, Ok(account)) = (self.is_done(), kept.account()) {
            let from = self.seat.inputs.iter().map(|input| input.from.as_str());
            self.tally.settle(&account, from);
        }
        // Counts that cannot be cleared must not be read again.
        if kept.clear().is_err() {
            self.kept = None;
            self.seat.ledger = None;
        }
    }

    /// Prepares the seat of the next incarnation from the last report.
    fn next_life(&mut self) {
        let last: Report = self.tally.end_life();
        self.seat.restarts += 1;
        if let Some(output) = &mut self.seat.output {
            output.former = self.tally.sums().emitted;
        }
        for (input, report) in self.seat.inputs.iter_mut().zip(&last.inputs) {
            input.resume = report.position.or(input.resume);
        }
        let is_source = self.seat.inputs.is_empty();
        if is_source
            && last.emitted > 0
            && let Some(config) = self.seat.config.as_object_mut()
        {
            config.insert("after_ns".to_owned(), last.stamp_ns.into());
        }
    }

    /// Prevents further restarts.
    pub fn no_restart(&mut self) {
        self.last_life = true;
        if self.is_waiting() {
            self.state = State::Lost;
        }
    }

    /// Sets the time by which it should end by itself.
    pub fn finish_by(&mut self, by: Instant) {
        self.last_life = true;
        self.finish_by.get_or_insert(by);
    }

    /// Notes the request to end. A stage that does not end becomes [`Local::overdue`], a `recorder` later than
    /// others. Returns whether it runs and was not asked before.
    pub fn is_to_end(&mut self, recorder: bool) -> bool {
        let first = self.patience.is_none();
        self.patience
            .get_or_insert_with(|| Patience::new(recorder, Instant::now()));
        first && self.is_running()
    }

    /// Returns the action that is due on a stage that should have ended.
    pub fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        if !self.is_running() {
            return None;
        }
        self.patience.as_mut()?.overdue(now)
    }

    /// Notes that it is killed because it does not end.
    pub fn is_killed(&mut self) {
        self.killed = true;
    }
}

/// Prefix of [`Local::death`] if the stage reports the reason itself.
pub const FAILED: &str = "failed";
