//! A worker process, which runs stage groups in a few event loops.
//!
//! The supervisor that starts the process communicates with it in lines:
//!
//! | channel | content |
//! | --- | --- |
//! | standard input, `[...]` | a list of [`Seat`]s that starts a stage group, each stage after the one whose stream it receives |
//! | standard input, `stop NAME` | stops the group with the stage of that name: it processes the samples that have arrived and completes its streams |
//! | standard input, `stop`, or `SIGTERM` | stops every group |
//! | standard input, its end | stops every group, and then the process |
//! | standard output | one [`Line`] each, as of a [`child`](super::child); each names its stage |
//!
//! When a stage fails or panics, its whole group ends, each stage of the group reports that, and the other groups
//! continue. The supervisor may restart the group by sending its seats again.
//!
//! Groups that may block have an event loop of their own: a sink writes to disks and sockets, and a stage whose
//! receivers must lose nothing waits for them. All others share one loop per core.

use std::error::Error;
use std::io::{self, BufRead as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::task::{Poll, Waker};
use std::thread::{Builder, JoinHandle};

use super::child::{
    ChildError, Line, check_shape, ends, say, say_posted, say_ready, stop_on_signals,
};
use super::event_loop::{EventLoop, Task, panic_message};
use super::group::{Ends, Node, set_failed};
use super::report::text_of;
use super::{Board, Context, Outcome, REPORT_EVERY, Report, Stop};
use crate::seat::{Seat, Transports};

/// Largest number of groups that wait for their loop.
/// Resolution: memory; a group waits for microseconds.
const ARRIVING: usize = 16;

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
type Make = dyn Fn(&[Seat]) -> Result<Vec<Node<'static>>, Unmade> + Send + Sync;

/// State of a worker process that its threads share.
#[derive(Clone)]
struct Worker {
    make: Arc<Make>,
    transports: Transports,
    groups: Arc<Mutex<Vec<Alive>>>,
    loops: Arc<Mutex<Loops>>,
}

/// A running group.
struct Alive {
    stages: Vec<String>,
    stop: Stop,
    board: Board,
}

/// The event loops.
#[derive(Default)]
struct Loops {
    /// Those that groups share.
    shared: Vec<LoopHandle>,
    /// Number of groups that were given to shared loops.
    given: usize,
    threads: Vec<JoinHandle<()>>,
}

/// Gives groups to an event loop.
#[derive(Clone)]
struct LoopHandle {
    tasks: mpsc::SyncSender<Task<'static>>,
    waker: Waker,
}

/// Runs a worker process to its end: starts the groups that standard input assigns to it, with the stages that `make`
/// creates from their seats.
pub fn worker<M>(make: M) -> ExitCode
where
    M: Fn(&[Seat]) -> Result<Vec<Node<'static>>, Unmade> + Send + Sync + 'static,
{
    let worker = Worker {
        make: Arc::new(make),
        transports: Transports::default(),
        groups: Arc::default(),
        loops: Arc::default(),
    };
    let stop_all = {
        let groups = Arc::clone(&worker.groups);
        move || lock(&groups).iter().for_each(|group| group.stop.stop())
    };
    if let Err(error) = stop_on_signals(stop_all.clone()) {
        eprintln!("error: {}", ChildError::Signals(error));
        return ExitCode::FAILURE;
    }
    let (_ends, until_it_ends) = mpsc::channel::<()>();
    let groups = Arc::clone(&worker.groups);
    std::thread::spawn(move || report_now_and_then(&groups, &until_it_ends));
    let mut code = ExitCode::SUCCESS;
    let mut building = Vec::new();
    for line in io::stdin().lock().lines().map_while(Result::ok) {
        match line.trim() {
            "stop" => stop_all(),
            line if line.starts_with('[') => match serde_json::from_str::<Vec<Seat>>(line) {
                Ok(seats) => {
                    let context = worker.note(&seats);
                    let builder = worker.clone();
                    // A stage may take long to build. Its loop runs other groups meanwhile.
                    let build = move || builder.build(&seats, context);
                    match Builder::new().name("build".to_owned()).spawn(build) {
                        Ok(thread) => building.push(thread),
                        Err(error) => {
                            eprintln!("error: cannot start a thread for a stage group: {error}");
                            return ExitCode::FAILURE;
                        }
                    }
                    building.retain(|thread| !thread.is_finished());
                }
                Err(error) => {
                    eprintln!("error: {}", ChildError::NotASeat(error));
                    code = ExitCode::FAILURE;
                }
            },
            line => {
                let named = line.strip_prefix("stop ");
                for group in lock(&worker.groups).iter() {
                    if named.is_some_and(|name| group.stages.iter().any(|stage| stage == name)) {
                        group.stop.stop();
                    }
                }
            }
        }
    }
    stop_all();
    for thread in building {
        // `build` catches panics.
        let _ = thread.join();
    }
    let Loops {
        shared, threads, ..
    } = std::mem::take(&mut *lock(&worker.loops));
    for LoopHandle { tasks, waker } in shared {
        drop(tasks);
        waker.wake();
    }
    for thread in threads {
        // A loop catches the panics of its groups.
        let _ = thread.join();
    }
    code
}

fn report_now_and_then(groups: &Mutex<Vec<Alive>>, until_it_ends: &mpsc::Receiver<()>) {
    while until_it_ends.recv_timeout(REPORT_EVERY) == Err(mpsc::RecvTimeoutError::Timeout) {
        let boards: Vec<Board> = lock(groups)
            .iter()
            .map(|group| group.board.clone())
            .collect();
        for board in boards {
            say_posted(&board);
        }
    }
}

impl Worker {
    /// Registers a new group.
    fn note(&self, seats: &[Seat]) -> Context {
        let alive = Alive {
            stages: seats.iter().map(|seat| seat.stage.clone()).collect(),
            stop: Stop::new(),
            board: Board::default(),
        };
        let context = Context {
            stage: alive.stages.first().cloned().unwrap_or_default(),
            stop: alive.stop.clone(),
            board: alive.board.clone(),
        };
        lock(&self.groups).push(alive);
        context
    }

    /// Creates the stages of a group, opens their senders, and gives the group to a loop.
    fn build(&self, seats: &[Seat], context: Context) {
        let made = catch_unwind(AssertUnwindSafe(|| self.nodes(seats)));
        let first = seats.first().map_or("", |seat| &seat.stage).to_owned();
        let failed = match made {
            Ok(Ok(nodes)) => match self.loop_for(seats, &nodes) {
                Ok(handle) => {
                    let LoopHandle { tasks, waker } = handle;
                    let given = tasks.send(self.task(seats, nodes, context));
                    debug_assert!(given.is_ok(), "a loop lives as long as its handle");
                    // The loop learns with the wake-up whether it is to expect more groups.
                    drop(tasks);
                    waker.wake();
                    return;
                }
                Err(error) => (first, text_of(&error)),
            },
            Ok(Err(unmade)) => (unmade.stage, unmade.why),
            Err(panic) => (first, format!("it panicked: {}", panic_message(&*panic))),
        };
        let new = |seat: &Seat| Report {
            stage: seat.stage.clone(),
            ..Report::default()
        };
        let mut reports: Vec<Report> = seats.iter().map(new).collect();
        set_failed(&mut reports, &failed.0, &Outcome::Failed(failed.1));
        context.board.post(&reports);
        self.end(&context.stage, reports);
    }

    fn nodes(&self, seats: &[Seat]) -> Result<Vec<(Node<'static>, Ends)>, Unmade> {
        let nodes = (self.make)(seats)?.into_iter().zip(seats);
        let nodes = nodes.map(|(node, seat)| {
            let ends = check_shape(&node, seat).and_then(|()| Ok(ends(seat, &self.transports)?));
            let ends = ends.map_err(|error: ChildError| Unmade::new(&seat.stage, &error))?;
            Ok((node, ends))
        });
        nodes.collect()
    }

    fn task(
        &self,
        seats: &[Seat],
        nodes: Vec<(Node<'static>, Ends)>,
        context: Context,
    ) -> Task<'static> {
        let (worker, first) = (self.clone(), context.stage.clone());
        Task {
            nodes,
            context,
            within: (seats.iter().map(Seat::start_within))
                .max()
                .unwrap_or_default(),
            ready: say_ready,
            done: Box::new(move |reports| worker.end(&first, reports)),
        }
    }

    fn end(&self, first: &str, reports: Vec<Report>) {
        lock(&self.groups).retain(|group| !group.stages.iter().any(|stage| stage == first));
        for report in reports {
            say(&Line::Done(report));
        }
    }

    /// Returns the loop for a group, and starts it if necessary.
    fn loop_for(&self, seats: &[Seat], nodes: &[(Node<'static>, Ends)]) -> io::Result<LoopHandle> {
        let mut loops = lock(&self.loops);
        loops.threads.retain(|thread| !thread.is_finished());
        // The thread has the name of its first stage, for the tools of the system.
        let name = seats.first().map_or("", |seat| &seat.stage);
        if seats.iter().any(Seat::may_wait) || nodes.iter().any(|(node, _)| node.is_sink()) {
            return loops.start(name);
        }
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        if loops.shared.len() < cores {
            let handle = loops.start(name)?;
            loops.shared.push(handle);
        }
        let next = loops.given % loops.shared.len();
        loops.given += 1;
        Ok(loops.shared[next].clone())
    }
}

impl Loops {
    /// Starts a loop, which ends when its handle is dropped and its groups have ended.
    fn start(&mut self, name: &str) -> io::Result<LoopHandle> {
        let (tasks, arrivals) = mpsc::sync_channel(ARRIVING);
        let (ready, told) = mpsc::sync_channel(1);
        // A group holds references that stay in their thread, so the loop is created there.
        let run = move || {
            let event_loop = match EventLoop::new() {
                Ok(event_loop) => event_loop,
                Err(error) => {
                    let _ = ready.send(Err(error));
                    return;
                }
            };
            let _ = ready.send(Ok(event_loop.waker()));
            event_loop.run(&mut || match arrivals.try_recv() {
                Ok(task) => Poll::Ready(Some(task)),
                Err(mpsc::TryRecvError::Empty) => Poll::Pending,
                Err(mpsc::TryRecvError::Disconnected) => Poll::Ready(None),
            });
        };
        self.threads
            .push(Builder::new().name(name.to_owned()).spawn(run)?);
        let waker = told.recv().map_err(io::Error::other)??;
        Ok(LoopHandle { tasks, waker })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
