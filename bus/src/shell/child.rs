//! A stage in a process of its own, such as a stage from another crate.
//!
//! The supervisor that starts the process communicates with it in lines of JSON:
//!
//! | channel | content |
//! | --- | --- |
//! | standard input, first line | the [`Seat`] |
//! | standard input, later lines | the line `stop`, or the end of the input, requests a stop: the stage processes the samples that have arrived, completes its output and exits. `SIGTERM` does the same; `SIGINT` is left to the supervisor, since a terminal sends it to both |
//! | standard output | one [`Line`] each: `{"event":"ready","missing":0}` once its receivers are connected (or the wait for them is over); `{"event":"report",...}` ten times a second; `{"event":"stuck",...}` instead while it is hung; `{"event":"note","text":"..."}` for a finding; `{"event":"done",...}` at the end |
//! | standard error | free text, for people |
//! | exit code | 0 ended or stopped, 1 failed |
//!
//! The start-up order needs no coordinator. A process opens its senders, waits until the expected receivers are
//! connected, and only then opens its own receivers. Readiness thus propagates from the sinks to the sources, and
//! nothing is sent before all receivers are connected.

use std::error::Error;
use std::io::{self, BufRead as _, Write as _};
use std::process::ExitCode;
use std::sync::mpsc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use tokio::signal::unix::{SignalKind, signal};

use super::event_loop;
use super::group::{Ends, Input, Node};
use super::report::text_of;
use super::{Board, Context, Ledger, Outcome, REPORT_EVERY, Report, Stop};
use crate::link::LinkError;
use crate::sample::{Sample, SampleKind};
use crate::seat::{Links, Seat, TransportKind, Transports};
use crate::stage::Stage;

/// A line of a stage's process on standard output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Line {
    /// Start of the stage.
    Ready {
        /// Name of the stage, if the process has several.
        #[serde(default)]
        stage: String,
        /// Number of expected receivers that are not connected.
        missing: usize,
    },
    /// Periodic report.
    Report(Report),
    /// Finding of the stage, for people.
    Note {
        /// Name of the stage, if the process has several.
        #[serde(default)]
        stage: String,
        /// Text of the finding.
        text: String,
    },
    /// Lasting condition of the stage from now on.
    Holds {
        /// Name of the stage.
        stage: String,
        /// Condition in a word or two; empty for none.
        text: String,
    },
    /// Hung stage: it has not finished processing a sample, and blocks all stages in its thread. There are no reports
    /// meanwhile.
    Stuck {
        /// Name of the stage.
        stage: String,
        /// Duration so far \[ms\].
        for_ms: u64,
    },
    /// Final report.
    Done(Report),
}

/// Failure of a process to start its stage.
#[derive(Debug, thiserror::Error)]
pub enum ChildError {
    /// Missing line on standard input.
    #[error("no seat on standard input: {0}")]
    NoSeat(#[source] io::Error),
    /// First line that is not a seat.
    #[error("the first line on standard input is no seat: {0}")]
    NotASeat(#[source] serde_json::Error),
    /// Signal handlers that cannot be installed.
    #[error("cannot listen to signals: {0}")]
    Signals(#[source] io::Error),
    /// Seat with the wrong inputs or output for this kind of stage.
    #[error("the seat of `{stage}` has {found}, expected {expected}")]
    Shape {
        /// Name of the stage.
        stage: String,
        /// Inputs and output that this kind of stage needs.
        expected: &'static str,
        /// Inputs and output of the seat.
        found: String,
    },
    /// Event loop that cannot be started.
    #[error("cannot start the event loop: {0}")]
    System(#[source] io::Error),
    /// Link that cannot be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// The process of a stage, with its seat.
#[derive(Debug)]
pub struct Child {
    seat: Seat,
    context: Context,
}

impl Child {
    /// Reads the seat from standard input, and handles stop requests from then on.
    ///
    /// # Errors
    /// If there is no seat, or signal handlers cannot be installed.
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
            stop,
            ..Context::default()
        };
        Ok(Self { seat, context })
    }

    /// The seat.
    pub fn seat(&self) -> &Seat {
        &self.seat
    }

    /// Runs `stage` to its end.
    pub fn stage<I: Sample, O: Sample>(self, stage: &mut dyn Stage<I, O>) -> ExitCode {
        let Self { seat, context } = &self;
        let node = Node::stage(Box::new(stage));
        let ready = check_shape(&node, seat).and_then(|()| Ok(ends(seat, &Transports::default())?));
        let ran = ready.and_then(|ends| {
            let within = seat.start_within();
            let run = || event_loop::run(context, within, say_ready, vec![(node, ends)]);
            reporting(&context.board, run).map_err(ChildError::System)
        });
        match ran {
            Ok(mut reports) => done(reports.pop().unwrap_or_default()),
            Err(error) => self.fail(&error),
        }
    }

    /// Reports that the stage could not be created from its seat.
    pub fn fail(self, error: &dyn Error) -> ExitCode {
        done(Report {
            stage: self.seat.stage,
            outcome: Some(Outcome::Failed(text_of(error))),
            ..Report::default()
        })
    }
}

fn done(report: Report) -> ExitCode {
    let failed = report.outcome.as_ref().and_then(Outcome::failure).is_some();
    say(&Line::Done(report));
    ExitCode::from(u8::from(failed))
}

/// The `main` of a stage from another crate: reads the seat from standard input, creates the stage for it, and runs
/// the stage to its end.
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
            // Without a seat there is no supervisor that reads standard output.
            let _ = writeln!(io::stderr(), "{error}");
            return ExitCode::FAILURE;
        }
    };
    match make(child.seat()) {
        Ok(mut stage) => child.stage(&mut stage),
        Err(error) => child.fail(&error),
    }
}

/// Checks that a seat has the inputs and the output of a kind of node.
pub(super) fn check_shape(node: &Node<'_>, seat: &Seat) -> Result<(), ChildError> {
    let (inputs, output) = (seat.inputs.len(), seat.output.is_some());
    let (fits, expected) = if node.is_source() {
        (inputs == 0 && output, "no input and an output")
    } else if node.is_sink() {
        (inputs > 0 && !output, "inputs and no output")
    } else {
        (inputs == 1 && output, "one input and an output")
    };
    if fits {
        return Ok(());
    }
    let output = if output { "an" } else { "no" };
    Err(ChildError::Shape {
        stage: seat.stage.clone(),
        expected,
        found: format!("{inputs} inputs and {output} output"),
    })
}

/// Opens the senders of a seat, and prepares its receivers.
pub(super) fn ends(seat: &Seat, transports: &Transports) -> Result<Ends, LinkError> {
    let open = |output| Links::of(seat, transports).any_sender(output);
    let inputs = seat.inputs.iter().map(|input| {
        let (from, links) = (input.from.clone(), Links::of(seat, transports));
        match (input.transport, input.kind) {
            (TransportKind::InProcess, SampleKind::Health) => Input::HealthOf(from),
            (TransportKind::InProcess, _) => Input::Of(from),
            (TransportKind::Iceoryx2 | TransportKind::Zenoh, _) => {
                let input = input.clone();
                let open = move || links.any_receiver(&input);
                Input::Link {
                    from,
                    open: Box::new(open),
                }
            }
        }
    });
    let health = seat.health.as_ref().map(open).transpose()?.flatten();
    Ok(Ends {
        stage: seat.stage.clone(),
        restarts: seat.restarts,
        inputs: inputs.collect(),
        output: seat.output.as_ref().map(open).transpose()?.flatten(),
        health: health.map(|health| health.typed(&seat.stage)).transpose()?,
        ledger: Ledger::of(seat),
    })
}

/// Runs `body` while another thread writes the reports on the status board at a fixed interval.
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

/// Writes the reports on the status board, except final ones.
pub(super) fn say_posted(board: &Board) {
    // Locked before the board is read, so that no older report follows a newer one.
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
    // One write for all stages: a process that is killed meanwhile has reported all of them or none.
    let _ = out.write_all(&text).and_then(|()| out.flush());
}

/// Reports the start of a stage.
pub(super) fn say_ready(stage: &str, missing: usize) {
    say(&Line::Ready {
        stage: stage.to_owned(),
        missing,
    });
}

/// Reports a finding of a stage of this process.
pub fn note(stage: &str, text: &str) {
    say(&Line::Note {
        stage: stage.to_owned(),
        text: text.to_owned(),
    });
}

/// Reports a lasting condition of a stage of this process; an empty `text` ends it.
pub fn holds(stage: &str, text: &str) {
    say(&Line::Holds {
        stage: stage.to_owned(),
        text: text.to_owned(),
    });
}

/// Writes a line. A write error is ignored: a supervisor that no longer reads also closes standard input.
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

/// Requests a stop on the line `stop` or at the end of standard input. The thread is not joined: it ends with the
/// process.
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
        // `_interrupt` is kept for the life of the process: the signal is caught and ignored.
    });
    Ok(())
}
