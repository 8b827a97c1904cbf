//! Supervisor of the stages of one host, which run in worker processes.
//!
//! Stages of one process that are linked within it form a group: they start, end and fail together, alone or with
//! their process. A group that fails is restarted, at once the first time and then after growing delays; one that
//! fails too often is given up, and the run ends. On Ctrl-C or SIGTERM the sources are ended, and the other stages
//! finish with the samples that they have. A second signal ends everything at once but recorders, which complete
//! their files; a third one ends these, too. A stage that does not end is reported and then killed. Nothing outlives
//! the supervisor: a stage ends when its standard input closes, and Linux kills it when its parent dies.
//!
//! A stage that receives nothing usable is reported within seconds, with what is received instead ([`watchdog`]).

mod exit_words;
mod flow;
mod ledger;
mod liveness;
mod lives;
mod local;
mod patience;
mod process;
mod reported;
mod restart;
mod router;
mod seats;
mod service;
mod silence;
mod summary;
mod tally;
mod view;
mod watchdog;
mod worker;

use std::time::Duration;

use anyhow::Context;
use tauscope_bus::{Domain, Seat, SharedMemory};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc;
use tokio::time::Instant;

use crate::plan::{Link, Over};
use local::Local;
use process::Event;
use reported::Reported;
use router::Router;
pub use seats::Instructions;
use service::Service;
pub use summary::{Ended, Summary};
use tauscope_pipeline::announce;
use tauscope_pipeline::pipeline::Pipeline;
pub use view::Verbosity;
use view::View;
use worker::Worker;

/// Time for a stage to finish by itself after all of its inputs have ended; then the supervisor asks it to end.
const GRACE: Duration = Duration::from_secs(2);
/// Timer of the event loop while nothing is due.
const NEVER: Duration = Duration::from_hours(24);
/// Capacity of the event queue; a stage waits while it is full.
const EVENTS: usize = 256;
/// Poll interval of the watchdog.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Options of the supervision.
#[derive(Debug, Clone, Copy, Default)]
pub struct Care {
    /// Time without samples of a source after which the run fails.
    pub expect_data: Option<Duration>,
    /// Duration of the run from the first sample; `None` if it is unlimited.
    pub for_data: Option<Duration>,
    /// Verbosity of the output.
    pub verbosity: Verbosity,
}

/// Process, and its incarnation, that an event is from.
type Mark = (usize, u64);

/// Runs the stages on `host` (all stages if `None`) until they have ended.
///
/// # Errors
/// If the host's endpoints cannot be opened, or a process cannot be started.
pub fn run(
    pipeline: &Pipeline,
    links: &[Link],
    host: Option<&str>,
    care: Care,
) -> anyhow::Result<Summary> {
    // Killed runs could not remove their own files.
    if let Err(error) = tauscope_bus::link::remove_left_behind() {
        eprintln!(
            "warning: what killed runs have left in /tmp and /dev/shm cannot be removed: {error}"
        );
    }
    let domain = Domain::unique();
    let router = Router::open(pipeline, links, host)?;
    let meeting_point = router.as_ref().map(Router::endpoint);
    let seats = seats::seats(pipeline, links, host, &domain, meeting_point)?;
    // One thread, which waits for pipes, processes and signals. Linux sends the death signal of a child when the
    // thread that started it ends.
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot wait for processes")?;
    let outcome = runtime.block_on(supervise(pipeline, links, seats, &domain, care));
    // Best effort: leftovers do no harm.
    let _ = domain.remove();
    outcome
}

async fn supervise(
    pipeline: &Pipeline,
    links: &[Link],
    seats: Vec<(usize, Seat)>,
    domain: &Domain,
    care: Care,
) -> anyhow::Result<Summary> {
    let here = |at: usize| seats.iter().any(|(place, _)| *place == at);
    let shares = |link: &Link| link.over == Over::SharedMemory && here(link.to);
    let shared_memory = if links.iter().any(shares) {
        Some(SharedMemory::open(domain)?)
    } else {
        None
    };
    let (sender, events) = mpsc::channel(EVENTS);
    let now = Instant::now();
    let (stages, workers) = lives::workers(pipeline, links, seats);
    let mut supervisor = Supervisor {
        pipeline,
        stages,
        workers,
        shared_memory,
        sender,
        stopping: false,
        hurried: false,
        ended: Ended::Completed,
        view: View::new(care.verbosity, now.into_std()),
        service: Service::new(),
        care,
        began: now,
        told_unready: false,
        first_sample: None,
    };
    // Installed before the first stage starts: an interrupt in between would kill this process and leave the
    // recorders' files incomplete.
    let signals = [
        signal(SignalKind::interrupt()).context("cannot catch Ctrl-C")?,
        signal(SignalKind::terminate()).context("cannot catch SIGTERM")?,
    ];
    supervisor.start_all()?;
    supervisor.watch(events, signals).await;
    let Supervisor { stages, ended, .. } = &supervisor;
    Ok(Summary::new(pipeline, links, stages, *ended))
}

struct Supervisor<'a> {
    pipeline: &'a Pipeline,
    stages: Vec<Local>,
    workers: Vec<Worker>,
    shared_memory: Option<SharedMemory>,
    sender: mpsc::Sender<(Mark, Event)>,
    stopping: bool,
    /// Whether everything but recorders has been ended at once.
    hurried: bool,
    /// Reason for the end of the run.
    ended: Ended,
    view: View,
    service: Service,
    care: Care,
    began: Instant,
    /// Whether stages that are not ready have been reported.
    told_unready: bool,
    /// Time of the first sample of a source.
    first_sample: Option<Instant>,
}

impl Supervisor<'_> {
    async fn watch(
        &mut self,
        mut events: mpsc::Receiver<(Mark, Event)>,
        [mut interrupt, mut terminate]: [Signal; 2],
    ) {
        let mut look = tokio::time::interval(LOOK_EVERY);
        while !self.is_over() {
            let due = self.stages.iter().filter_map(Local::due).min();
            let alarm = due.unwrap_or_else(|| Instant::now() + NEVER);
            tokio::select! {
                Some((mark, event)) = events.recv() => self.take(mark, event),
                () = any(&mut interrupt, &mut terminate) => self.interrupted(),
                () = tokio::time::sleep_until(alarm) => self.alarm(),
                now = look.tick() => self.look(now),
            }
            self.close_workers();
        }
    }

    fn take(&mut self, (worker, life): Mark, event: Event) {
        // The exit is the last event of an incarnation, so none of an earlier one can follow.
        debug_assert_eq!(self.workers[worker].life, life, "an event of another life");
        match event {
            Event::Said(line) => self
                .view
                .warn(&format!("[{}] {line}", self.workers[worker].name)),
            Event::Reported(line) => self.hear(worker, &line),
            Event::Exited(status) => {
                self.workers[worker].exited();
                self.process_ended(worker, &status);
                self.settle();
            }
        }
    }

    /// Handles a line of a process's standard output.
    fn hear(&mut self, worker: usize, line: &str) {
        let Some(index) = self.speaker(worker, line) else {
            let name = &self.workers[worker].name;
            self.view.note(&format!("[{name}] {line}"));
            return;
        };
        let stage = &mut self.stages[index];
        match stage.report(line) {
            Reported::Counts => {
                let root = stage.root;
                if stage.is_done() && !self.workers[worker].outside {
                    self.group_ended(root);
                }
            }
            // The watchdog reads these states at its next poll.
            Reported::Stuck | Reported::Holds => {}
            Reported::Ready { missing } => {
                let missing = match missing {
                    0 => String::new(),
                    some => format!(", without {some} of its listeners"),
                };
                let line = format!("stage `{}` begins{missing}", stage.seat.stage);
                self.view.detail(&line);
            }
            Reported::Note(text) => {
                let name = stage.seat.stage.clone();
                let muted = if self.is_muted(index) { " (muted)" } else { "" };
                self.view.note(&format!("[{name}] {text}{muted}"));
            }
            Reported::Other(line) => {
                self.view.note(&format!("[{}] {line}", stage.seat.stage));
            }
        }
    }

    /// Whether alarms of the stage at `index` raise no stop, because the source of its cell reports a mute.
    fn is_muted(&self, index: usize) -> bool {
        let finder = &self.stages[index];
        let of =
            |source: &Local, cell: &String| source.seat.cells.iter().any(|each| each.name == *cell);
        let mut sources = self.stages.iter().filter(|stage| stage.is_source());
        !finder.is_source()
            && sources.any(|source| {
                let mut cells = finder.seat.cells.iter().map(|cell| &cell.name);
                source.holds == announce::commands::MUTED && cells.any(|cell| of(source, cell))
            })
    }

    /// Frees the shared memory that a dead process still holds, so that processes waiting for it continue and its
    /// next incarnation finds free memory.
    fn clean(&self) {
        if let Some(shared_memory) = &self.shared_memory {
            shared_memory.clean_dead_peers();
        }
    }

    fn interrupted(&mut self) {
        if self.stopping {
            return self.end_at_once();
        }
        self.ended = Ended::Interrupted;
        self.view
            .note("ending the sources; the other stages finish (again to end everything)");
        self.stop();
    }

    /// Kills all processes but those of recorders, which are asked to complete their files: a killed recorder would
    /// leave a `.part`. A second call kills these, too.
    fn end_at_once(&mut self) {
        let spares = !std::mem::replace(&mut self.hurried, true);
        let records = |worker: &Worker| worker.stages.iter().any(|&index| self.is_recorder(index));
        let spared: Vec<bool> = self
            .workers
            .iter()
            .map(|it| spares && records(it))
            .collect();
        self.view.note(if spared.contains(&true) {
            "ending everything at once; recorders complete their files (again to end them, too)"
        } else {
            "ending everything at once"
        });
        for (worker, is_spared) in spared.into_iter().enumerate() {
            for index in self.workers[worker].stages.clone() {
                if is_spared {
                    let recorder = self.is_recorder(index);
                    self.ask_to_end(index, recorder);
                } else {
                    self.stages[index].is_to_end(false);
                }
            }
            if !is_spared {
                self.workers[worker].kill();
            }
        }
    }

    /// Ends the run: the stages without inputs on this host are asked to end; the others follow as their inputs end.
    fn stop(&mut self) {
        self.stopping = true;
        service::ends();
        for stage in &mut self.stages {
            stage.no_restart();
        }
        self.settle();
    }

    /// Ends stages whose inputs on this host are over. If the run stops, sources and stages with inputs from other
    /// hosts are asked at once; stages with local inputs only get [`GRACE`] to finish by themselves.
    fn settle(&mut self) {
        for index in 0..self.stages.len() {
            let inputs = &self.pipeline.stages[self.stages[index].at].inputs;
            let local = |at: &usize| self.stages.iter().find(|stage| stage.at == *at);
            let all_over = inputs.iter().filter_map(local).all(Local::is_over);
            let is_remote = inputs.iter().any(|at| local(at).is_none());
            let is_source = inputs.is_empty();
            let recorder = self.is_recorder(index);
            let stage = &mut self.stages[index];
            if self.stopping && all_over && (is_source || is_remote) {
                self.ask_to_end(index, recorder);
            } else if all_over && !is_source && !is_remote {
                stage.finish_by(Instant::now() + GRACE);
            }
        }
    }

    fn is_recorder(&self, index: usize) -> bool {
        let stage = &self.pipeline.stages[self.stages[index].at];
        stage.role.kind.is::<tauscope_record::Config>()
    }

    fn alarm(&mut self) {
        let now = Instant::now();
        for index in 0..self.stages.len() {
            if self.stages[index].due().is_none_or(|due| due > now) {
                continue;
            }
            if !self.stages[index].is_waiting() {
                let recorder = self.is_recorder(index);
                self.ask_to_end(index, recorder);
                continue;
            }
            let root = self.stages[index].root;
            if let Err(error) = self.start(root) {
                self.view.warn(&format!("error: {error:#}"));
                for index in self.group(root) {
                    self.stages[index].give_up();
                }
                self.stop();
            }
        }
    }
}

async fn any(one: &mut Signal, other: &mut Signal) {
    tokio::select! {
        _ = one.recv() => {}
        _ = other.recv() => {}
    }
}
