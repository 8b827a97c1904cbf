//! One stage of this host, through all its lives.

use std::process::ExitStatus;
use std::time::Duration;

use tauscope_bus::Seat;
use tauscope_bus::shell::{Line, Outcome, Report};
use tokio::time::Instant;

use super::process::Process;
use super::restart::Deaths;
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
    told_to_stop: bool,
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

impl Local {
    /// A stage that is to be started.
    pub fn new(at: usize, seat: Seat) -> Self {
        Self {
            at,
            seat,
            tally: Tally::default(),
            state: State::Waiting(Instant::now()),
            deaths: Deaths::default(),
            last_life: false,
            ready: false,
            told_to_stop: false,
            finish_by: None,
        }
    }

    /// Its process has been started.
    pub fn started(&mut self, process: Process) {
        self.state = State::Running(process);
        self.ready = false;
        self.told_to_stop = false;
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
            State::Running(_) if !self.told_to_stop => self.finish_by,
            _ => None,
        }
    }

    /// How far a source is.
    pub fn fraction_done(&self) -> Option<f64> {
        self.tally.newest().fraction_done
    }

    /// Takes a line of its standard output; false if it is none of the protocol.
    pub fn report(&mut self, line: &str) -> bool {
        match serde_json::from_str(line) {
            Ok(Line::Ready { .. }) => self.ready = true,
            Ok(Line::Report(report) | Line::Done(report)) => self.tally.note(report),
            Err(_) => return false,
        }
        true
    }

    /// Its process has ended, and all that it said was heard.
    pub fn exited(&mut self, status: std::io::Result<ExitStatus>) -> End {
        let outcome = self.tally.newest().outcome.clone();
        // One that says itself why it cannot even begin would say the same again, as would one whose
        // input is not what it was made for.
        let said_why = outcome.is_some();
        let is_unfit = matches!(outcome, Some(Outcome::Unfit(_)));
        let how = match (status, outcome) {
            (Ok(status), _) if status.success() => {
                self.state = State::Ended;
                return End::InOrder;
            }
            (_, Some(Outcome::Failed(why) | Outcome::Unfit(why))) => format!("failed: {why}"),
            (Ok(status), _) => words_for(status),
            (Err(error), _) => format!("cannot be waited for: {error}"),
        };
        let can_begin = (self.ready || !said_why) && !is_unfit;
        let may_return = can_begin && !self.last_life && !self.told_to_stop;
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

    /// Asks it to end.
    pub fn stop(&mut self) {
        self.told_to_stop = true;
        if let State::Running(process) = &self.state {
            process.stop();
        }
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        self.told_to_stop = true;
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
