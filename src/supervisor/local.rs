//! One stage of this host, through all its lives.

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
    /// Its place in the pipeline.
    pub at: usize,
    /// What its process is told.
    pub seat: Seat,
    /// The process it runs in, by its place among those of this host.
    pub crew: usize,
    /// The first stage of its tree, by its place among those of this host. They begin, end and die together.
    pub root: usize,
    /// What it has done, over all its lives.
    pub tally: Tally,
    state: State,
    deaths: Deaths,
    /// When it is started again; of a tree its first stage knows.
    policy: Option<Restart>,
    pulse: Pulse,
    /// No life follows this one.
    last_life: bool,
    /// It has said in this life that it begins.
    ready: bool,
    /// How its samples come.
    pub flow: Flow,
    /// What holds there, in a word or two; empty for nothing of note.
    pub holds: String,
    /// What was told of it while none came.
    pub silence: Silence,
    /// Since it was told to end.
    patience: Option<Patience>,
    /// It did not end and was killed.
    killed: bool,
    /// By when it should have ended by itself.
    finish_by: Option<Instant>,
    /// What it keeps beyond its death; without it, its reports must do.
    kept: Option<Kept>,
}

/// Whether it lives, in this life.
#[derive(Debug, Default)]
struct Pulse {
    /// When it last said how it fares.
    heard: Option<Instant>,
    /// Its process has said since then that this stage is what its thread is stuck in.
    stuck: bool,
    /// It was told that it hangs.
    hangs: bool,
}

#[derive(Debug)]
enum State {
    /// It runs.
    Running,
    /// It is started at this time, for the first time or again.
    Waiting(Instant),
    /// It has ended in order.
    Ended,
    /// It died and does not come back.
    Lost,
}

impl Local {
    /// A stage that is to be started.
    pub fn new(at: usize, mut seat: Seat, crew: usize, root: usize) -> Self {
        let now = Instant::now();
        let kept = Kept::new(seat.inputs.len()).ok();
        seat.ledger = kept.as_ref().map(Kept::path);
        Self {
            at,
            seat,
            crew,
            root,
            tally: Tally::default(),
            state: State::Waiting(now),
            deaths: Deaths::default(),
            policy: None,
            pulse: Pulse::default(),
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

    /// Whether it listens to nobody.
    pub fn is_source(&self) -> bool {
        self.seat.inputs.is_empty()
    }

    /// Whether it runs and has said that it begins.
    pub fn is_ready(&self) -> bool {
        self.ready && self.is_running()
    }

    /// Whether it did not end and was killed.
    pub fn was_killed(&self) -> bool {
        self.killed
    }

    /// Why it gives nothing that can be used, as it says itself.
    pub fn trouble(&self) -> Option<&Trouble> {
        self.tally.newest().trouble.as_ref()
    }

    /// Whether its process has been told to run it, and it has not ended.
    pub fn is_running(&self) -> bool {
        matches!(self.state, State::Running)
    }

    /// Whether it has said in this life that it is over.
    pub fn is_done(&self) -> bool {
        self.tally.newest().outcome.is_some()
    }

    /// Its process has been told to run it.
    pub fn started(&mut self) {
        self.state = State::Running;
        self.ready = false;
        self.holds.clear();
        self.pulse = Pulse::default();
        self.patience = None;
    }

    /// It cannot be started, or not any more.
    pub fn give_up(&mut self) {
        self.state = State::Lost;
    }

    /// Whether nothing more comes from it.
    pub fn is_over(&self) -> bool {
        matches!(self.state, State::Ended | State::Lost)
    }

    /// Whether it died and did not come back.
    pub fn is_lost(&self) -> bool {
        matches!(self.state, State::Lost)
    }

    /// Whether it is to be started.
    pub fn is_waiting(&self) -> bool {
        matches!(self.state, State::Waiting(_))
    }

    /// When there is something to do for it.
    pub fn due(&self) -> Option<Instant> {
        match self.state {
            State::Waiting(at) => Some(at),
            State::Running if self.patience.is_none() => self.finish_by,
            _ => None,
        }
    }

    /// How far a source is.
    pub fn fraction_done(&self) -> Option<f64> {
        self.tally.newest().fraction_done
    }

    /// Takes a line of its standard output; what is none of the protocol comes back.
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
                self.pulse.stuck = true;
                return Reported::Stuck;
            }
            Err(_) => return Reported::Other(line),
        }
        let now = Instant::now();
        self.pulse.heard = Some(now);
        self.pulse.stuck = false;
        let moved = self.flow.note(self.samples(), now.into_std());
        if let Some(patience) = self.patience.as_mut().filter(|_| moved) {
            patience.extend(now);
        }
        Reported::Counts
    }

    /// Samples that came in; for a source, those that went out.
    fn samples(&self) -> u64 {
        let sums = self.tally.sums();
        if self.is_source() {
            return sums.emitted;
        }
        let inputs = self.seat.inputs.iter().zip(&sums.inputs);
        let data = inputs.filter(|(input, _)| input.kind != SampleKind::Health);
        data.map(|(_, counts)| counts.received).sum()
    }

    /// How it died, where it did: by its process's end if `exit` is given, else by what it said itself.
    pub fn death(&self, exit: Option<&std::io::Result<ExitStatus>>) -> Option<String> {
        let outcome = self.tally.newest().outcome.as_ref();
        let failed = outcome.and_then(Outcome::failure);
        if self.killed {
            return Some("did not end when it was told to, was killed".to_owned());
        }
        match (failed, exit) {
            (Some(why), _) => Some(format!("{FAILED}: {why}")),
            (None, None) => None,
            (None, Some(Ok(status))) => Some(exit_words::of(*status)),
            (None, Some(Err(error))) => Some(format!("cannot be waited for: {error}")),
        }
    }

    /// Whether it says that it ended because another stage of its tree did.
    pub fn fell_with_another(&self) -> bool {
        let outcome = self.tally.newest().outcome.as_ref();
        outcome.is_some_and(Outcome::is_of_another)
    }

    /// Whether another life could fare better. One that says itself why it cannot even begin would say the same again,
    /// as would one whose input is not what it was made for.
    pub fn may_return(&self) -> bool {
        let outcome = self.tally.newest().outcome.as_ref();
        let is_unfit = matches!(outcome, Some(Outcome::Unfit(_)));
        let can_begin = (self.ready || outcome.is_none()) && !is_unfit;
        can_begin && !self.last_life && self.patience.is_none()
    }

    /// Notes a death of its tree, and says after what time it is started again, if it is.
    pub fn note_death(&mut self) -> Option<Duration> {
        let policy = self.policy.unwrap_or_default();
        self.deaths.note(&policy, std::time::Instant::now())
    }

    /// Its tree is started again by this policy, too.
    pub fn restart_by(&mut self, policy: Restart) {
        let policy = self.policy.map_or(policy, |own| own.strictest(policy));
        self.policy = Some(policy);
    }

    /// Whether it is started again although it ended in order.
    pub fn returns_always(&self) -> bool {
        let always = self
            .policy
            .is_some_and(|policy| policy.when == When::Always);
        always && !self.last_life && self.patience.is_none()
    }

    /// For how long it has not said how it fares, which a stage does ten times a second while it runs. Not of one that
    /// has never said it in this life: it waits for others, or does not speak.
    pub fn unheard_for(&self, now: Instant) -> Option<Duration> {
        let heard = self
            .pulse
            .heard
            .filter(|_| self.is_running() && !self.is_done());
        heard.map(|heard| now.duration_since(heard))
    }

    /// Whether it is the one of its thread that does not go on, as its process says.
    pub fn is_stuck(&self) -> bool {
        self.pulse.stuck
    }

    /// Notes whether it hangs; true if that is new.
    pub fn note_hangs(&mut self, hangs: bool) -> bool {
        std::mem::replace(&mut self.pulse.hangs, hangs) != hangs
    }

    /// Whether it hangs, as far as was noted.
    pub fn hangs(&self) -> bool {
        self.pulse.hangs
    }

    /// It has ended in order.
    pub fn end(&mut self) {
        self.state = State::Ended;
    }

    /// It died, and is started again after this time, if it is.
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

    /// Takes over what it has noted since its last report, and makes room for the next life. One that has said itself
    /// how it ended has counted all.
    fn settle(&mut self) {
        let Some(kept) = &self.kept else { return };
        if let (false, Ok(account)) = (self.is_done(), kept.account()) {
            let from = self.seat.inputs.iter().map(|input| input.from.as_str());
            self.tally.settle(&account, from);
        }
        // What cannot be cleared is not to be read any more.
        if kept.clear().is_err() {
            self.kept = None;
            self.seat.ledger = None;
        }
    }

    /// Makes the seat of the next life out of what the last one has said.
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

    /// No life follows this one.
    pub fn no_restart(&mut self) {
        self.last_life = true;
        if self.is_waiting() {
            self.state = State::Lost;
        }
    }

    /// It should end by itself by then.
    pub fn finish_by(&mut self, by: Instant) {
        self.last_life = true;
        self.finish_by.get_or_insert(by);
    }

    /// It is told to end; a stage that does not is [`Local::overdue`] then, a `recorder` later than others. Whether it
    /// was not told before.
    pub fn is_to_end(&mut self, recorder: bool) -> bool {
        let first = self.patience.is_none();
        self.patience
            .get_or_insert_with(|| Patience::new(recorder, Instant::now()));
        first && self.is_running()
    }

    /// Whether it should have ended by now, and what is to be done of it.
    pub fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        if !self.is_running() {
            return None;
        }
        self.patience.as_mut()?.overdue(now)
    }

    /// It does not end, and is killed.
    pub fn is_killed(&mut self) {
        self.killed = true;
    }
}

/// How [`Local::death`] begins where a stage says itself why.
pub const FAILED: &str = "failed";
