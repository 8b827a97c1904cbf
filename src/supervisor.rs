//! Runs the stages of one host in their processes, and looks after them.
//!
//! Stages of one process that hear each other are a tree: they begin, end and die together, alone or with their process.
//! A stage that dies is started again, at once the first time and later the more often it dies; one
//! that dies too often is given up, and with it the run. On Ctrl-C or SIGTERM the sources are ended
//! and the rest finishes with what it has; a second time everything ends at once, but for recorders, which complete their
//! files; a third time they end, too. A stage that does not
//! end is named and then killed. Nothing outlives the supervisor: a stage ends when its standard input
//! closes, and Linux kills it when its parent dies.
//!
//! Whoever gets nothing it can use is named within seconds, with what is there instead ([`watchman`]).

mod crew;
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
mod watchman;

use std::time::Duration;

use anyhow::Context;
use tauscope_bus::{Domain, Seat, SharedMemory};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::mpsc;
use tokio::time::Instant;

use crate::announce;
use crate::plan::{Link, Over};
use crew::Crew;
use local::Local;
use process::Event;
use reported::Reported;
use router::Router;
pub use seats::Instructions;
use service::Service;
pub use summary::{Ended, Summary};
use tauscope_pipeline::pipeline::{Pipeline, Role};
pub use view::Verbosity;
use view::View;

/// A stage whose inputs have all ended has this long to finish by itself before it is asked to.
const GRACE: Duration = Duration::from_secs(2);
/// Long enough where nothing is due.
const NEVER: Duration = Duration::from_hours(24);
/// Events that are not handled yet; a stage that says more waits.
const EVENTS: usize = 256;
/// How often it is looked who is silent or does not end.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// How a run is looked after.
#[derive(Debug, Clone, Copy, Default)]
pub struct Care {
    /// A run in which a source gives nothing for so long has failed.
    pub expect_data: Option<Duration>,
    /// The run ends by itself so long after the first sample.
    pub for_data: Option<Duration>,
    /// How much is told.
    pub verbosity: Verbosity,
}

/// Which life of which process an event belongs to.
type Mark = (usize, u64);

/// Runs the stages on `host` (all without one) until they have ended.
///
/// # Errors
/// If the host's endpoints cannot be opened, or a process cannot be started.
pub fn run(
    pipeline: &Pipeline,
    links: &[Link],
    host: Option<&str>,
    care: Care,
) -> anyhow::Result<Summary> {
    // A run that was killed could not do it itself.
    if let Err(error) = tauscope_bus::link::remove_left_behind() {
        eprintln!(
            "warning: what killed runs have left in /tmp and /dev/shm cannot be removed: {error}"
        );
    }
    let domain = Domain::unique();
    let router = Router::open(pipeline, links, host)?;
    let meeting_point = router.as_ref().map(Router::endpoint);
    let seats = seats::seats(pipeline, links, host, &domain, meeting_point)?;
    // One thread: it waits for pipes, processes and signals. And Linux ties a child's life to the
    // thread that started it.
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot wait for processes")?;
    let outcome = runtime.block_on(supervise(pipeline, links, seats, &domain, care));
    // Best effort: what is left of it does no harm.
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
    let (stages, crews) = lives::crews(pipeline, links, seats);
    let mut supervisor = Supervisor {
        pipeline,
        stages,
        crews,
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
    // Caught from before the first stage starts: an interrupt in between would kill this process and
    // leave the recorders' files incomplete.
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
    crews: Vec<Crew>,
    shared_memory: Option<SharedMemory>,
    sender: mpsc::Sender<(Mark, Event)>,
    stopping: bool,
    /// Everything was to end at once, but for recorders.
    hurried: bool,
    /// Why it ends.
    ended: Ended,
    view: View,
    service: Service,
    care: Care,
    began: Instant,
    /// It was told which stages do not begin.
    told_unready: bool,
    /// When a source gave its first sample.
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
            self.close_crews();
        }
    }

    fn take(&mut self, (crew, life): Mark, event: Event) {
        // Each life's exit is its last event, so there are none of earlier ones.
        debug_assert_eq!(self.crews[crew].life, life, "an event of another life");
        match event {
            Event::Said(line) => self
                .view
                .warn(&format!("[{}] {line}", self.crews[crew].name)),
            Event::Reported(line) => self.hear(crew, &line),
            Event::Exited(status) => {
                self.crews[crew].exited();
                self.process_ended(crew, &status);
                self.settle();
            }
        }
    }

    /// Takes a line of a process's standard output.
    fn hear(&mut self, crew: usize, line: &str) {
        let Some(index) = self.speaker(crew, line) else {
            let name = &self.crews[crew].name;
            self.view.note(&format!("[{name}] {line}"));
            return;
        };
        let stage = &mut self.stages[index];
        match stage.report(line) {
            Reported::Counts => {
                let root = stage.root;
                if stage.is_done() && !self.crews[crew].outside {
                    self.tree_ended(root);
                }
            }
            // What follows of that is looked at four times a second.
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

    /// Whether what the stage at `index` finds raises no stop: the source of its cell says that a mute holds.
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

    /// Frees what the dead process still holds in shared memory, so that those who wait for it go on
    /// and its next life finds room.
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

    /// Somebody does not want to wait. A recorder that is killed would leave a `.part`, so it is asked to complete what
    /// it has; the next time nobody is spared.
    fn end_at_once(&mut self) {
        let spares = !std::mem::replace(&mut self.hurried, true);
        let records = |crew: &Crew| crew.stages.iter().any(|&index| self.is_recorder(index));
        let spared: Vec<bool> = self.crews.iter().map(|it| spares && records(it)).collect();
        self.view.note(if spared.contains(&true) {
            "ending everything at once; recorders complete their files (again to end them, too)"
        } else {
            "ending everything at once"
        });
        for (crew, is_spared) in spared.into_iter().enumerate() {
            for index in self.crews[crew].stages.clone() {
                if is_spared {
                    let recorder = self.is_recorder(index);
                    self.ask_to_end(index, recorder);
                } else {
                    self.stages[index].is_to_end(false);
                }
            }
            if !is_spared {
                self.crews[crew].kill();
            }
        }
    }

    /// Ends the stages that listen to nobody here; the others follow as their inputs end.
    fn stop(&mut self) {
        self.stopping = true;
        service::ends();
        for stage in &mut self.stages {
            stage.no_restart();
        }
        self.settle();
    }

    /// Asks those to end whose time has come.
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
        self.pipeline.stages[self.stages[index].at].role == Role::Record
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
                for index in self.tree(root) {
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
