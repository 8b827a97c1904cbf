//! One stage of this host, through all its lives.

use std::process::ExitStatus;
use std::time::Duration;

use tauscope_bus::shell::{Line, Outcome, Report};
use tauscope_bus::{SampleKind, Seat, Trouble};
use tokio::time::Instant;

use super::flow::Flow;
use super::patience::{Overdue, Patience};
use super::process::Process;
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
    /// What it has done, over all its lives.
    pub tally: Tally,
    state: State,
    deaths: Deaths,
    /// No life follows this one.
    last_life: bool,
    /// It has said in this life that it begins.
    ready: bool,
    /// How its samples come.
    pub flow: Flow,
    /// What was told of it while none came.
    pub silence: Silence,
    /// Since it was told to end.
    patience: Option<Patience>,
    /// It did not end and was killed.
    killed: bool,
    /// By when it should have ended by itself.
    finish_by: Option<Instant>,
}

#[derive(Debug)]
enum State {
    /// Its process runs.
    Running(Process),
    /// It is started at this time, for the first time or again.
    Waiting(Instant),
    /// It has ended in order.
    Ended,
    /// It died and does not come back.
    Lost,
}

/// How a process ended.
#[derive(Debug, PartialEq, Eq)]
pub enum End {
    /// It had nothing more to do, or did what it was told.
    InOrder,
    /// It died.
    Died {
        /// In words: `was killed by signal 9`.
        how: String,
        /// After what time it is started again, if it is.
        again: Option<Duration>,
    },
}

/// What a line of a stage's standard output said.
#[derive(Debug, PartialEq, Eq)]
pub enum Reported<'a> {
    /// It begins, with so many receivers missing.
    Ready {
        /// How many.
        missing: usize,
    },
    /// What it has counted.
    Counts,
    /// What it has found.
    Note(String),
    /// Something that is none of the protocol.
    Other(&'a str),
}

impl Local {
    /// A stage that is to be started.
    pub fn new(at: usize, seat: Seat) -> Self {
        let now = Instant::now();
        Self {
            at,
            seat,
            tally: Tally::default(),
            state: State::Waiting(now),
            deaths: Deaths::default(),
            last_life: false,
            ready: false,
            flow: Flow::new(now.into_std()),
            silence: Silence::default(),
            patience: None,
            killed: false,
            finish_by: None,
        }
    }

    /// Whether it listens to nobody.
    pub fn is_source(&self) -> bool {
        self.seat.inputs.is_empty()
    }

    /// Whether it runs and has said that it begins.
    pub fn is_ready(&self) -> bool {
        self.ready && matches!(self.state, State::Running(_))
    }

    /// Whether it did not end and was killed.
    pub fn was_killed(&self) -> bool {
        self.killed
    }

    /// Why it gives nothing that can be used, as it says itself.
    pub fn trouble(&self) -> Option<&Trouble> {
        self.tally.newest().trouble.as_ref()
    }

    /// Its process has been started.
    pub fn started(&mut self, process: Process) {
        self.state = State::Running(process);
        self.ready = false;
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
            State::Running(_) if self.patience.is_none() => self.finish_by,
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
            Ok(Line::Ready { missing }) => {
                self.ready = true;
                return Reported::Ready { missing };
            }
            Ok(Line::Report(report) | Line::Done(report)) => self.tally.note(report),
            Ok(Line::Note { text }) => return Reported::Note(text),
            Err(_) => return Reported::Other(line),
        }
        let now = Instant::now();
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

    /// Its process has ended, and all that it said was heard.
    pub fn exited(&mut self, status: std::io::Result<ExitStatus>) -> End {
        let outcome = self.tally.newest().outcome.clone();
        // One that says itself why it cannot even begin would say the same again, as would one whose
        // input is not what it was made for.
        let said_why = outcome.is_some();
        let is_unfit = matches!(outcome, Some(Outcome::Unfit(_)));
        let how = match (status, outcome) {
            (Ok(status), _) if status.success() && !self.killed => {
                self.state = State::Ended;
                return End::InOrder;
            }
            _ if self.killed => "did not end when it was told to, was killed".to_owned(),
            (_, Some(Outcome::Failed(why) | Outcome::Unfit(why))) => format!("failed: {why}"),
            (Ok(status), _) => words_for(status),
            (Err(error), _) => format!("cannot be waited for: {error}"),
        };
        let can_begin = (self.ready || !said_why) && !is_unfit;
        let may_return = can_begin && !self.last_life && self.patience.is_none();
        let again = if may_return {
            self.deaths.note(std::time::Instant::now())
        } else {
            None
        };
        self.state = match again {
            Some(wait) => {
                self.next_life();
                State::Waiting(Instant::now() + wait)
            }
            None => State::Lost,
        };
        End::Died { how, again }
    }

    /// Makes the seat of the next life out of what the last one has said.
    fn next_life(&mut self) {
        let last: Report = self.tally.end_life();
        self.seat.restarts += 1;
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

    /// Asks it to end; a stage that does not is [`Local::overdue`] then, a `recorder` later than others.
    pub fn stop(&mut self, recorder: bool) {
        self.patience
            .get_or_insert_with(|| Patience::new(recorder, Instant::now()));
        if let State::Running(process) = &self.state {
            process.stop();
        }
    }

    /// Whether it should have ended by now, and what is to be done of it.
    pub fn overdue(&mut self, now: Instant) -> Option<Overdue> {
        let State::Running(_) = &self.state else {
            return None;
        };
        self.patience.as_mut()?.overdue(now)
    }

    /// Ends it at once, since it did not end itself.
    pub fn kill_stubborn(&mut self) {
        self.killed = true;
        self.kill();
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        self.patience
            .get_or_insert_with(|| Patience::new(false, Instant::now()));
        if let State::Running(process) = &self.state {
            process.kill();
        }
    }
}

fn words_for(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("was killed by signal {signal}"),
        (None, Some(code)) => format!("ended with exit code {code}"),
        (None, None) => "ended".to_owned(),
    }
}
