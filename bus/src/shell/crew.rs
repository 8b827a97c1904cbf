//! A worker process that runs stage groups ([`Tree`]s), each in a thread of its own.
//!
//! The supervisor that starts the process communicates with it in lines:
//!
//! | channel | content |
//! | --- | --- |
//! | standard input, `[...]` | a list of [`Seat`]s that starts a stage group, each stage after the one whose stream it receives; or the seat of one sink |
//! | standard input, `stop NAME` | stops the group with the stage of that name: it processes the samples that have arrived and completes its streams |
//! | standard input, `stop`, or `SIGTERM` | stops every group |
//! | standard input, its end | stops every group, and then the process |
//! | standard output | one [`Line`] each, as of a [`child`](super::child); each names its stage |
//!
//! When a stage fails or panics, its whole group ends, each stage of the group reports that, and the other groups
//! continue. The supervisor may restart the group by sending its seats again.

use std::error::Error;
use std::io::{self, BufRead as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};

use super::child::{
    ChildError, Line, REPORT_EVERY, health_sender, say, say_posted, say_ready, stop_on_signals,
};
use super::report::text_of;
use super::tree::{Branch, Opening, Outlet, Post, Tree, Turn, branch, fell, words_of};
use super::{Board, Context, Ledger, Outcome, Report, SinkInput, Stop, run_sink};
use crate::link::{LinkError, Receiver};
use crate::sample::{Detection, JointState, Sample, TwinState};
use crate::seat::{Input, Links, Output, Seat, TransportKind, Transports};
use crate::stage::{Sink, Source, Stage};

/// A stage of this program, created from its seat.
pub enum Member {
    /// A source.
    Source(Box<dyn Source<JointState>>),
    /// A twin.
    Twin(Box<dyn Stage<JointState, TwinState>>),
    /// A detector, or a watch.
    Judge(Box<dyn Stage<TwinState, Detection>>),
    /// A recorder, or a publisher.
    Sink(Box<dyn Sink>),
}

/// Failure to create or to start a stage.
#[derive(Debug)]
pub struct Unmade {
    stage: String,
    why: String,
}

impl Unmade {
    /// Failure of `stage`, with its cause.
    pub fn new(stage: &str, why: &dyn Error) -> Self {
        Self {
            stage: stage.to_owned(),
            why: text_of(why),
        }
    }
}

/// Creates the stages of one group from their seats.
type Make = dyn Fn(&[Seat]) -> Result<Vec<Member>, Unmade> + Send + Sync;

/// The running groups.
type Running = Arc<Mutex<Vec<Alive>>>;

struct Alive {
    stages: Vec<String>,
    stop: Stop,
    board: Board,
}

/// Runs a worker process to its end: starts the groups that standard input assigns to it, with the stages that `make`
/// creates from their seats.
pub fn crew<M>(make: M) -> ExitCode
where
    M: Fn(&[Seat]) -> Result<Vec<Member>, Unmade> + Send + Sync + 'static,
{
    let make: Arc<Make> = Arc::new(make);
    let running = Running::default();
    let stop_all = {
        let running = Arc::clone(&running);
        move || lock(&running).iter().for_each(|tree| tree.stop.stop())
    };
    if let Err(error) = stop_on_signals(stop_all.clone()) {
        eprintln!("error: {}", ChildError::Signals(error));
        return ExitCode::FAILURE;
    }
    let (_ends, until_it_ends) = mpsc::channel::<()>();
    let reported = Arc::clone(&running);
    std::thread::spawn(move || report_now_and_then(&reported, &until_it_ends));
    let transports = Transports::default();
    let mut threads = Vec::new();
    let mut code = ExitCode::SUCCESS;
    for line in io::stdin().lock().lines().map_while(Result::ok) {
        match line.trim() {
            "stop" => stop_all(),
            line if line.starts_with('[') => match serde_json::from_str::<Vec<Seat>>(line) {
                Ok(seats) => {
                    let (make, transports) = (Arc::clone(&make), transports.clone());
                    let alive = Alive {
                        stages: seats.iter().map(|seat| seat.stage.clone()).collect(),
                        stop: Stop::new(),
                        board: Board::default(),
                    };
                    let context = Context {
                        stage: alive.stages.first().cloned().unwrap_or_default(),
                        restarts: seats.first().map_or(0, |seat| seat.restarts),
                        stop: alive.stop.clone(),
                        board: alive.board.clone(),
                    };
                    lock(&running).push(alive);
                    let running = Arc::clone(&running);
                    let name = context.stage.clone();
                    let live = move || live(&seats, &context, &transports, &*make, &running);
                    match std::thread::Builder::new().name(name).spawn(live) {
                        Ok(thread) => threads.push(thread),
                        Err(error) => {
                            eprintln!("error: cannot start a thread for a stage group: {error}");
                            return ExitCode::FAILURE;
                        }
                    }
                    threads.retain(|thread| !thread.is_finished());
                }
                Err(error) => {
                    eprintln!("error: {}", ChildError::NotASeat(error));
                    code = ExitCode::FAILURE;
                }
            },
            line => {
                let named = line.strip_prefix("stop ");
                for tree in lock(&running).iter() {
                    if named.is_some_and(|name| tree.stages.iter().any(|stage| stage == name)) {
                        tree.stop.stop();
                    }
                }
            }
        }
    }
    stop_all();
    for thread in threads {
        // `live` catches the panics of its group.
        let _ = thread.join();
    }
    code
}

fn report_now_and_then(running: &Running, until_it_ends: &mpsc::Receiver<()>) {
    while until_it_ends.recv_timeout(REPORT_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
        let boards: Vec<Board> = lock(running)
            .iter()
            .map(|tree| tree.board.clone())
            .collect();
        for board in boards {
            say_posted(&board);
        }
    }
}

/// Runs a group from its start to its end.
fn live(
    seats: &[Seat],
    context: &Context,
    transports: &Transports,
    make: &Make,
    running: &Running,
) {
    let lived = catch_unwind(AssertUnwindSafe(|| {
        let members = make(seats)?;
        run(seats, members, context, transports)
    }));
    let first = seats.first().map_or("", |seat| &seat.stage);
    let failed = match lived {
        Ok(Ok(reports)) => Ok(reports),
        Ok(Err(unmade)) => Err((unmade.stage, unmade.why)),
        Err(panic) => Err((
            first.to_owned(),
            format!("it panicked: {}", words_of(&*panic)),
        )),
    };
    let reports = failed.unwrap_or_else(|(stage, why)| {
        // The last reports; before the group has started, the board is empty.
        let mut reports = context.board.read();
        if reports.is_empty() {
            let new = |seat: &Seat| Report {
                stage: seat.stage.clone(),
                ..Report::default()
            };
            reports = seats.iter().map(new).collect();
        }
        fell(&mut reports, &stage, &Outcome::Failed(why));
        reports
    });
    context.board.post(&reports);
    lock(running).retain(|tree| !tree.stages.iter().any(|stage| stage == first));
    for report in reports {
        say(&Line::Done(report));
    }
}

fn run(
    seats: &[Seat],
    mut members: Vec<Member>,
    context: &Context,
    transports: &Transports,
) -> Result<Vec<Report>, Unmade> {
    let Some(first) = seats.first() else {
        return Ok(Vec::new());
    };
    if let [Member::Sink(sink)] = members.as_mut_slice() {
        let links = Links::of(first, transports);
        let failed = |error: ChildError| Unmade::new(&first.stage, &error);
        return sink_here(&links, first, &mut **sink, context)
            .map(|report| vec![report])
            .map_err(failed);
    }
    let mut tree = Grower::new(transports).grow(seats, members)?;
    let within = seats.iter().map(Seat::start_within).max();
    tree.begin(context, within.unwrap_or_default(), &mut say_ready)
        .map_err(|error| Unmade::new(&first.stage, &error))?;
    Ok(tree.run(context))
}

fn sink_here(
    links: &Links,
    seat: &Seat,
    sink: &mut dyn Sink,
    context: &Context,
) -> Result<Report, ChildError> {
    if seat.inputs.is_empty() || seat.output.is_some() {
        return Err(shape(seat, "inputs and no output"));
    }
    let mut health = health_sender(links, seat)?;
    let missing = health.wait_for_receivers(seat.start_within())?;
    say_ready(&seat.stage, missing);
    let inputs = seat.inputs.iter().map(|input| {
        Ok(SinkInput {
            from: input.from.clone(),
            receiver: links.any_receiver(input)?,
            looks: input.looks(),
        })
    });
    let inputs = inputs.collect::<Result<_, LinkError>>()?;
    Ok(run_sink(
        context,
        sink,
        inputs,
        &mut *health,
        &Ledger::of(seat),
    ))
}

fn shape(seat: &Seat, expected: &'static str) -> ChildError {
    let output = if seat.output.is_some() { "an" } else { "no" };
    ChildError::Shape {
        stage: seat.stage.clone(),
        expected,
        found: format!("{} inputs and {output} output", seat.inputs.len()),
    }
}

/// Branches whose preceding stage is not built yet, by the name of that stage.
type Branches<T> = Vec<(String, Box<dyn Branch<T>>)>;

/// Builds a group from its last stages back to its first one.
struct Grower<'a> {
    transports: &'a Transports,
    turn: Turn,
    on_states: Branches<JointState>,
    on_twins: Branches<TwinState>,
    tree: Option<Tree<'static>>,
}

impl<'a> Grower<'a> {
    fn new(transports: &'a Transports) -> Self {
        Self {
            transports,
            turn: Turn::default(),
            on_states: Vec::new(),
            on_twins: Vec::new(),
            tree: None,
        }
    }

    fn grow(mut self, seats: &[Seat], members: Vec<Member>) -> Result<Tree<'static>, Unmade> {
        for (seat, member) in seats.iter().zip(members).rev() {
            self.add(seat, member)
                .map_err(|error| Unmade::new(&seat.stage, &error))?;
        }
        let loose = self.on_states.len() + self.on_twins.len();
        match (self.tree, seats.first()) {
            (Some(tree), _) if loose == 0 => Ok(tree),
            (_, first) => {
                let stage = first.map_or("", |seat| &seat.stage);
                let why = io::Error::other("the seats make no tree");
                Err(Unmade::new(stage, &why))
            }
        }
    }

    fn add(&mut self, seat: &Seat, member: Member) -> Result<(), ChildError> {
        let links = Links::of(seat, self.transports);
        let post = Post {
            stage: seat.stage.clone(),
            restarts: seat.restarts,
            from: seat
                .inputs
                .first()
                .map_or_else(String::new, |input| input.from.clone()),
            health: health_sender(&links, seat)?,
            ledger: Ledger::of(seat),
        };
        let Some(output) = &seat.output else {
            return Err(shape(seat, "an output"));
        };
        match (member, seat.inputs.as_slice()) {
            (Member::Source(source), []) => {
                let behind = behind(&mut self.on_states, &seat.stage);
                let out = Outlet::new(behind, link(&links, output)?);
                self.tree = Some(Tree::of_source(&self.turn, post, source, out));
            }
            (Member::Twin(twin), [input]) => {
                let behind = behind(&mut self.on_twins, &seat.stage);
                let out = Outlet::new(behind, link(&links, output)?);
                let branch = branch(&self.turn, post, twin, out);
                self.tree = attach(&self.turn, &mut self.on_states, branch, input, links)
                    .or(self.tree.take());
            }
            (Member::Judge(judge), [input]) => {
                let out = Outlet::new(Vec::new(), link(&links, output)?);
                let branch = branch(&self.turn, post, judge, out);
                self.tree = attach(&self.turn, &mut self.on_twins, branch, input, links)
                    .or(self.tree.take());
            }
            (Member::Source(_), _) => return Err(shape(seat, "no input and an output")),
            _ => return Err(shape(seat, "one input and an output")),
        }
        Ok(())
    }
}

/// Opens the sending end of a stream, if it has receivers outside its group.
fn link<T: Sample>(
    links: &Links,
    output: &Output,
) -> Result<Option<Box<dyn crate::link::Sender<T>>>, LinkError> {
    if output.links.is_empty() {
        return Ok(None);
    }
    links.sender(output).map(Some)
}

/// Keeps a branch for its preceding stage or, if its input comes over a link, starts a group with it.
fn attach<I: Sample>(
    turn: &Turn,
    loose: &mut Branches<I>,
    branch: Box<dyn Branch<I>>,
    input: &Input,
    links: Links,
) -> Option<Tree<'static>> {
    if input.transport == TransportKind::InProcess {
        loose.push((input.from.clone(), branch));
        return None;
    }
    let input = input.clone();
    let open: Opening<'static, I> =
        Box::new(move || Ok(links.receiver::<I>(&input)? as Box<dyn Receiver<I>>));
    Some(Tree::of_link(turn, branch, open))
}

/// The branches on the stream of `stage`, in the order of the seats.
fn behind<T>(loose: &mut Branches<T>, stage: &str) -> Vec<Box<dyn Branch<T>>> {
    let (mine, others) = std::mem::take(loose)
        .into_iter()
        .partition(|(from, _): &(String, _)| from == stage);
    *loose = others;
    let mine: Branches<T> = mine;
    mine.into_iter().rev().map(|(_, branch)| branch).collect()
}

fn lock(running: &Running) -> MutexGuard<'_, Vec<Alive>> {
    running.lock().unwrap_or_else(PoisonError::into_inner)
}
