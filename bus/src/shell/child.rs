//! A stage in a process of its own.
//!
//! Whoever starts the process (a supervisor) talks to it in lines of JSON:
//!
//! | where | what |
//! | --- | --- |
//! | standard input, first line | the [`Seat`] |
//! | standard input, from then on | the line `stop`, or its end, tells the stage to stop: it deals with what has arrived, completes its output and leaves. `SIGTERM` does the same; `SIGINT` is left to the supervisor, since a terminal sends it to both |
//! | standard output | one [`Line`] each: `{"event":"ready","missing":0}` once its receivers are connected (or the wait for them is over), `{"event":"report",...}` ten times a second, `{"event":"note","text":"..."}` where it found something, `{"event":"done",...}` at the end |
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
use super::{Context, Outcome, Report, SinkInput, Stop, run_sink, run_source, run_stage};
use crate::link::{FanOut, LinkError, Sender};
use crate::sample::{Health, Sample};
use crate::seat::{Links, Output, Seat};
use crate::stage::{Sink, Source, Stage};

/// How often a running stage reports: what a killed stage did since then is not known.
/// Resolution: the cost of reporting.
const REPORT_EVERY: Duration = Duration::from_millis(100);
/// How often the wait for receivers looks whether the stage is to stop.
/// Resolution: how soon a stop is noticed.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// What a stage's process says on standard output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Line {
    /// It begins.
    Ready {
        /// How many of the receivers it expects are not there.
        missing: usize,
    },
    /// It runs.
    Report(Report),
    /// It found something that people want to know.
    Note {
        /// What.
        text: String,
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
        stop_on_signals(stop.clone()).map_err(ChildError::Signals)?;
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

    /// Runs `source` here to its end.
    pub fn source<T: Sample>(self, source: &mut dyn Source<T>) -> ExitCode {
        self.run(|child, links, health| {
            let Seat { inputs, output, .. } = &child.seat;
            let (true, Some(output)) = (inputs.is_empty(), output) else {
                return Err(child.shape("no input and an output"));
            };
            let mut sender = links.sender::<T>(output)?;
            child.ready(Some(&mut *sender), health)?;
            Ok(run_source(&child.context, source, &mut *sender, health))
        })
    }

    /// Runs `stage` here to its end.
    pub fn stage<I: Sample, O: Sample>(self, stage: &mut dyn Stage<I, O>) -> ExitCode {
        self.run(|child, links, health| {
            let Seat { inputs, output, .. } = &child.seat;
            let ([input], Some(output)) = (inputs.as_slice(), output) else {
                return Err(child.shape("one input and an output"));
            };
            let mut sender = links.sender::<O>(output)?;
            child.ready(Some(&mut *sender), health)?;
            let mut receiver = links.receiver::<I>(input)?;
            Ok(run_stage(
                &child.context,
                stage,
                &input.from,
                &mut *receiver,
                &mut *sender,
                health,
            ))
        })
    }

    /// Runs `sink` here to its end.
    pub fn sink(self, sink: &mut dyn Sink) -> ExitCode {
        self.run(|child, links, health| {
            if child.seat.inputs.is_empty() || child.seat.output.is_some() {
                return Err(child.shape("inputs and no output"));
            }
            child.ready::<Health>(None, health)?;
            let inputs = child.seat.inputs.iter().map(|input| {
                Ok(SinkInput {
                    from: input.from.clone(),
                    receiver: links.any_receiver(input)?,
                })
            });
            let inputs = inputs.collect::<Result<_, LinkError>>()?;
            Ok(run_sink(&child.context, sink, inputs, health))
        })
    }

    /// Says that the stage could not be made from its seat.
    pub fn fail(self, error: &dyn Error) -> ExitCode {
        done(Report {
            stage: self.seat.stage,
            outcome: Some(Outcome::Failed(text_of(error))),
            ..Report::default()
        })
    }

    fn run(
        self,
        body: impl FnOnce(&Self, &Links, &mut dyn Sender<Health>) -> Result<Report, ChildError>,
    ) -> ExitCode {
        let body = || -> Result<Report, ChildError> {
            let links = Links::open(&self.seat)?;
            let mut health = health_sender(&links, self.seat.health.as_ref())?;
            body(&self, &links, &mut *health)
        };
        let report = reporting(&self.context, body);
        match report {
            Ok(report) => done(report),
            Err(error) => self.fail(&error),
        }
    }

    /// Waits for the receivers of this stage's streams and says so.
    fn ready<T: Sample>(
        &self,
        output: Option<&mut dyn Sender<T>>,
        health: &mut dyn Sender<Health>,
    ) -> Result<(), ChildError> {
        let deadline = Instant::now() + self.seat.start_within();
        let mut missing = self.missing_at(deadline, health)?;
        if let Some(output) = output {
            missing += self.missing_at(deadline, output)?;
        }
        if missing > 0 {
            let within = self.seat.start_within();
            tracing::warn!(
                stage = self.seat.stage,
                missing,
                ?within,
                "receivers are not there"
            );
        }
        say(&Line::Ready { missing });
        Ok(())
    }

    /// How many receivers of `stream` are missing when all are there, it is time, or the stage is to
    /// stop.
    fn missing_at<T: Sample>(
        &self,
        deadline: Instant,
        stream: &mut dyn Sender<T>,
    ) -> Result<usize, LinkError> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let missing = stream.wait_for_receivers(left.min(LOOK_EVERY))?;
            if missing == 0 || left.is_zero() || self.context.stop.is_stopped() {
                return Ok(missing);
            }
        }
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

fn health_sender(
    links: &Links,
    output: Option<&Output>,
) -> Result<Box<dyn Sender<Health>>, LinkError> {
    match output {
        Some(output) => links.sender(output),
        None => Ok(Box::new(FanOut::new(Vec::new()))),
    }
}

/// Runs `body` while another thread says now and then what is on the board.
fn reporting<R>(context: &Context, body: impl FnOnce() -> R) -> R {
    std::thread::scope(|scope| {
        let (finished, until_finished) = mpsc::channel::<()>();
        scope.spawn(move || {
            while until_finished.recv_timeout(REPORT_EVERY) == Err(mpsc::RecvTimeoutError::Timeout)
            {
                for report in context.board.read() {
                    if report.outcome.is_none() {
                        say(&Line::Report(report));
                    }
                }
            }
        });
        let result = body();
        drop(finished);
        result
    })
}

/// Tells people what a stage that runs in this process has found.
pub fn note(text: &str) {
    say(&Line::Note {
        text: text.to_owned(),
    });
}

/// If the supervisor reads no more, the end of standard input says so: a line may be lost then.
fn say(line: &Line) {
    if let Ok(text) = serde_json::to_string(line) {
        let mut out = io::stdout().lock();
        let _ = writeln!(out, "{text}").and_then(|()| out.flush());
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

fn stop_on_signals(stop: Stop) -> io::Result<()> {
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
            stop.stop();
        }
        // `_interrupt` is caught and left alone for as long as the process lives.
    });
    Ok(())
}
