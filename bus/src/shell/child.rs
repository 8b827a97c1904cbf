//! A stage in a process of its own, such as one that is not ours.
//!
//! Whoever starts the process (a supervisor) talks to it in lines of JSON:
//!
//! | where | what |
//! | --- | --- |
//! | standard input, first line | the [`Seat`] |
//! | standard input, from then on | the line `stop`, or its end, tells the stage to stop: it deals with what has arrived, completes its output and leaves. `SIGTERM` does the same; `SIGINT` is left to the supervisor, since a terminal sends it to both |
//! | standard output | one [`Line`] each: `{"event":"ready","missing":0}` once its receivers are connected (or the wait for them is over), `{"event":"report",...}` ten times a second, `{"event":"stuck",...}` instead while it does not go on, `{"event":"note","text":"..."}` where it found something, `{"event":"done",...}` at the end |
//! | standard error | anything, for people |
//! | exit code | 0 ended or stopped, 1 failed |
//!
//! The order of a start needs no referee. A process opens its senders, waits until the receivers it
//! expects are connected, and only then opens its own receivers: so readiness travels from the sinks
//! up to the sources, and nothing is sent before all hear it.

use std::error::Error;
use std::io::{self, BufRead as _, Write as _};
use std::process::ExitCode;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use tokio::signal::unix::{SignalKind, signal};

use super::report::text_of;
use super::tree::{Outlet, Post, Tree, Turn, branch};
use super::{Board, Context, Ledger, Outcome, Report, Stop};
use crate::link::{FanOut, LinkError, Receiver, Sender};
use crate::sample::{Health, Sample};
use crate::seat::{Links, Seat, Transports};
use crate::stage::Stage;

/// How often a running stage reports: what a killed stage did since then is not known.
/// Resolution: the cost of reporting.
pub(super) const REPORT_EVERY: Duration = Duration::from_millis(100);

/// What a stage's process says on standard output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Line {
    /// It begins.
    Ready {
        /// The stage, where the process has several.
        #[serde(default)]
        stage: String,
        /// How many of the receivers it expects are not there.
        missing: usize,
    },
    /// It runs.
    Report(Report),
    /// It found something that people want to know.
    Note {
        /// The stage, where the process has several.
        #[serde(default)]
        stage: String,
        /// What.
        text: String,
    },
    /// What holds there from now on, in a word or two.
    Holds {
        /// The stage.
        stage: String,
        /// What; empty for nothing of note.
        text: String,
    },
    /// It, and all that run in its thread, do not go on: for so long it has not finished what it does with a sample.
    /// While that lasts there are no reports.
    Stuck {
        /// The stage.
        stage: String,
        /// For how long \[ms\].
        for_ms: u64,
    },
    /// It leaves.
    Done(Report),
}

/// Why a process cannot take its seat.
#[derive(Debug, thiserror::Error)]
pub enum ChildError {
    /// Standard input gave no line.
    #[error("no seat on standard input: {0}")]
    NoSeat(#[source] io::Error),
    /// The line is no seat.
    #[error("the first line on standard input is no seat: {0}")]
    NotASeat(#[source] serde_json::Error),
    /// Signals cannot be listened to.
    #[error("cannot listen to signals: {0}")]
    Signals(#[source] io::Error),
    /// The seat has no place for this kind of stage.
    #[error("the seat of `{stage}` has {found}, expected {expected}")]
    Shape {
        /// The stage.
        stage: String,
        /// What this kind of stage needs.
        expected: &'static str,
        /// What the seat has.
        found: String,
    },
    /// A link cannot be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// The process of a stage, seated.
#[derive(Debug)]
pub struct Child {
    seat: Seat,
    context: Context,
}

impl Child {
    /// Takes the seat that stands on standard input, and listens from now on to what tells it to
    /// stop.
    ///
    /// # Errors
    /// If there is none, or signals cannot be listened to.
    pub fn take_seat() -> Result<Self, ChildError> {
        let mut line = String::new();
        let length = io::stdin().read_line(&mut line);
        match length {
            Ok(0) => return Err(ChildError::NoSeat(io::ErrorKind::UnexpectedEof.into())),
            Ok(_) => {}
            Err(error) => return Err(ChildError::NoSeat(error)),
        }
        let seat: Seat = serde_json::from_str(&line).map_err(ChildError::NotASeat)?;
        let stop = Stop::new();
        stop_with_the_supervisor(stop.clone());
        let stopped = stop.clone();
        stop_on_signals(move || stopped.stop()).map_err(ChildError::Signals)?;
        let context = Context {
            stage: seat.stage.clone(),
            restarts: seat.restarts,
            stop,
            ..Context::default()
        };
        Ok(Self { seat, context })
    }

    /// Its seat.
    pub fn seat(&self) -> &Seat {
        &self.seat
    }

    /// Runs `stage` here to its end.
    pub fn stage<I: Sample, O: Sample>(self, stage: &mut dyn Stage<I, O>) -> ExitCode {
        let Self { seat, context } = &self;
        let report = reporting(&context.board, || {
            let Seat { inputs, output, .. } = seat;
            let ([input], Some(output)) = (inputs.as_slice(), output) else {
                return Err(self.shape("one input and an output"));
            };
            let links = Links::of(seat, &Transports::default());
            let turn = Turn::default();
            let out = Outlet::new(Vec::new(), Some(links.sender::<O>(output)?));
            let post = Post {
                stage: seat.stage.clone(),
                restarts: seat.restarts,
                from: input.from.clone(),
                health: health_sender(&links, seat)?,
                ledger: Ledger::of(seat),
            };
            let first = branch(&turn, post, Box::new(stage), out);
            let open = Box::new(|| Ok(links.receiver::<I>(input)? as Box<dyn Receiver<I>>));
            let mut tree = Tree::of_link(&turn, first, open);
            tree.begin(context, seat.start_within(), &mut say_ready)?;
            Ok(tree.run(context).pop().unwrap_or_default())
        });
        match report {
            Ok(report) => done(report),
            Err(error) => self.fail(&error),
        }
    }

    /// Says that the stage could not be made from its seat.
    pub fn fail(self, error: &dyn Error) -> ExitCode {
        done(Report {
            stage: self.seat.stage,
            outcome: Some(Outcome::Failed(text_of(error))),
            ..Report::default()
        })
    }

    fn shape(&self, expected: &'static str) -> ChildError {
        let output = if self.seat.output.is_some() {
            "an"
        } else {
            "no"
        };
        ChildError::Shape {
            stage: self.seat.stage.clone(),
            expected,
            found: format!("{} inputs and {output} output", self.seat.inputs.len()),
        }
    }
}

fn done(report: Report) -> ExitCode {
    let failed = report.outcome.as_ref().and_then(Outcome::failure).is_some();
    say(&Line::Done(report));
    ExitCode::from(u8::from(failed))
}

/// The `main` of a stage from another crate: takes the seat on standard input, makes the stage for
/// it, and runs it to its end.
///
/// ```no_run
/// # use tauscope_bus::{Detection, Emit, Seat, Stage, StageError, TwinState, shell};
/// struct Mine;
/// impl Stage<TwinState, Detection> for Mine {
///     fn accept(&mut self, twin: &TwinState, out: &mut dyn Emit<Detection>) -> Result<(), StageError> {
///         out.emit(&mut |detection| {
///             detection.header = twin.header;
///             detection.score = twin.residual[0].abs();
///         })?;
///         Ok(())
///     }
/// }
/// fn main() -> std::process::ExitCode {
///     shell::outside(|_seat: &Seat| Ok::<_, std::convert::Infallible>(Mine))
/// }
/// ```
pub fn outside<I, O, S, E>(make: impl FnOnce(&Seat) -> Result<S, E>) -> ExitCode
where
    I: Sample,
    O: Sample,
    S: Stage<I, O>,
    E: Error + 'static,
{
    let child = match Child::take_seat() {
        Ok(child) => child,
        Err(error) => {
            // Without a seat nobody reads lines from here.
            let _ = writeln!(io::stderr(), "{error}");
            return ExitCode::FAILURE;
        }
    };
    match make(child.seat()) {
        Ok(mut stage) => child.stage(&mut stage),
        Err(error) => child.fail(&error),
    }
}

/// Where the health of this seat's stage goes.
pub(super) fn health_sender(
    links: &Links,
    seat: &Seat,
) -> Result<Box<dyn Sender<Health>>, LinkError> {
    match &seat.health {
        Some(output) => links.sender(output),
        None => Ok(Box::new(FanOut::new(Vec::new()))),
    }
}

/// Runs `body` while another thread says now and then what is on the board.
pub(super) fn reporting<R>(board: &Board, body: impl FnOnce() -> R) -> R {
    std::thread::scope(|scope| {
        let (finished, until_finished) = mpsc::channel::<()>();
        scope.spawn(move || {
            while until_finished.recv_timeout(REPORT_EVERY) == Err(mpsc::RecvTimeoutError::Timeout)
            {
                say_posted(board);
            }
        });
        let result = body();
        drop(finished);
        result
    })
}

/// Says what is on the board, unless it has all been said for the last time.
pub(super) fn say_posted(board: &Board) {
    // Locked before it is read, so that no older report comes after a newer one.
    let mut out = io::stdout().lock();
    let mut text = Vec::new();
    if let Some((stage, silent_for)) = board.stuck(Instant::now()) {
        let for_ms = u64::try_from(silent_for.as_millis()).unwrap_or(u64::MAX);
        write_line(&mut text, &Line::Stuck { stage, for_ms });
    } else {
        let posted = board.read().into_iter();
        for report in posted.filter(|report| report.outcome.is_none()) {
            write_line(&mut text, &Line::Report(report));
        }
    }
    // At once: what is killed meanwhile has said what all have done, or nothing.
    let _ = out.write_all(&text).and_then(|()| out.flush());
}

/// Says that a stage begins.
pub(super) fn say_ready(stage: &str, missing: usize) {
    say(&Line::Ready {
        stage: stage.to_owned(),
        missing,
    });
}

/// Tells people what a stage that runs in this process has found.
pub fn note(stage: &str, text: &str) {
    say(&Line::Note {
        stage: stage.to_owned(),
        text: text.to_owned(),
    });
}

/// Tells people what holds at a stage of this process from now on; nothing of note if `text` is empty.
pub fn holds(stage: &str, text: &str) {
    say(&Line::Holds {
        stage: stage.to_owned(),
        text: text.to_owned(),
    });
}

/// If the supervisor reads no more, the end of standard input says so: a line may be lost then.
pub(super) fn say(line: &Line) {
    let mut out = io::stdout().lock();
    write_line(&mut out, line);
    let _ = out.flush();
}

fn write_line(out: &mut impl io::Write, line: &Line) {
    if let Ok(text) = serde_json::to_string(line) {
        let _ = writeln!(out, "{text}");
    }
}

/// Reads standard input to its end. The thread is not joined: it ends with the process.
fn stop_with_the_supervisor(stop: Stop) {
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            match line {
                Ok(line) if line.trim() == "stop" => break,
                Ok(_) => {}
                Err(_) => break,
            }
        }
        stop.stop();
    });
}

pub(super) fn stop_on_signals(stop: impl Fn() + Send + 'static) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build()?;
    let (mut terminate, _interrupt) = {
        let _entered = runtime.enter();
        (
            signal(SignalKind::terminate())?,
            signal(SignalKind::interrupt())?,
        )
    };
    std::thread::spawn(move || {
        if runtime.block_on(terminate.recv()).is_some() {
            stop();
        }
        // `_interrupt` is caught and left alone for as long as the process lives.
    });
    Ok(())
}
