//! The thread that communicates with a controller: it connects, agrees on a recipe, and puts packages into the queue.
//! It reconnects after every fault, without limit.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use super::fault::Fault;
use super::field::{Part, fields};
use super::recipe::{self, Numbers, Recipe};
use super::wire::{self, DATA, OUTPUTS, Packages, START, TEXT, VERSION};
use crate::config::UrRtdeConfig;
use crate::queue::Queue;
use crate::tcp;

/// Timeout for accepting a connection, for an answer, and between two packages of data.
/// Physical: a controller answers within milliseconds; a busy one skips some packages, not seconds.
const PATIENCE: Duration = Duration::from_millis(1500);
/// Timeout of a read, which bounds the latency of a stop.
const READ_FOR: Duration = Duration::from_millis(100);
/// First pause between two attempts to connect; doubled after each failed one up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(200);
/// Longest pause between two attempts to connect.
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Version of the protocol.
const PROTOCOL: u16 = 2;

/// A package of data.
#[derive(Debug, Clone, Copy)]
pub(super) struct Data {
    /// Time of reception \[ns since the epoch\].
    pub received_ns: i64,
    /// Number of the connection, from 1.
    pub connection: u64,
    /// Values of its fields.
    pub numbers: Numbers,
    /// Whether they include the inertia of the payload.
    pub has_inertia: bool,
}

/// State shared by the thread and the source.
#[derive(Debug)]
pub(super) struct Shared {
    /// Packages that wait for the source.
    pub queue: Queue<Data>,
    fault: Mutex<Option<Fault>>,
    stop: AtomicBool,
}

impl Shared {
    /// Returns the reason why there are no packages, if known.
    pub fn fault(&self) -> Option<Fault> {
        self.lock().clone()
    }

    /// Requests the thread to end.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Locks the fault, even if poisoned: no operation on it can be left half done.
    fn lock(&self) -> MutexGuard<'_, Option<Fault>> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Starts the thread.
///
/// # Errors
/// If the system cannot start a thread.
pub(super) fn start(settings: &UrRtdeConfig) -> std::io::Result<Arc<Shared>> {
    let shared = Arc::new(Shared {
        queue: Queue::new(settings.queue),
        fault: Mutex::new(None),
        stop: AtomicBool::new(false),
    });
    let (settings, ours) = (settings.clone(), Arc::clone(&shared));
    std::thread::Builder::new()
        .name("ur_rtde".to_owned())
        .spawn(move || talk(&settings, &ours))?;
    Ok(shared)
}

fn talk(settings: &UrRtdeConfig, shared: &Shared) {
    let mut pause = FIRST_PAUSE;
    for connection in 1.. {
        let mut was_well = false;
        let Err(fault) = session(settings, shared, connection, &mut was_well) else {
            return;
        };
        if was_well {
            pause = FIRST_PAUSE;
        }
        *shared.lock() = Some(fault);
        let until = Instant::now() + pause;
        while Instant::now() < until {
            if shared.is_stopped() {
                return;
            }
            std::thread::sleep(READ_FOR.min(pause));
        }
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// Runs one connection until its fault or the stop.
fn session(
    settings: &UrRtdeConfig,
    shared: &Shared,
    connection: u64,
    was_well: &mut bool,
) -> Result<(), Fault> {
    let stream = tcp::connect(&settings.address(), PATIENCE).map_err(Fault::Unreachable)?;
    let mut peer = Peer::new(stream, shared)?;
    let Some(recipe) = agree(settings, &mut peer)? else {
        return Ok(());
    };
    let has_inertia = recipe.has(Part::Inertia);
    while let Some(body) = peer.next(DATA, Fault::Silent)? {
        let numbers = recipe.numbers(&body)?;
        if !*was_well {
            *was_well = true;
            *shared.lock() = None;
        }
        shared.queue.push(Data {
            received_ns: now_ns(),
            connection,
            numbers,
            has_inertia,
        });
    }
    Ok(())
}

/// Agrees with the controller on its outputs and starts it; returns `None` at the stop.
fn agree(settings: &UrRtdeConfig, peer: &mut Peer<'_>) -> Result<Option<Recipe>, Fault> {
    let unanswered = Fault::Unanswered("the request for a protocol version");
    let Some(answer) = peer.ask(VERSION, &PROTOCOL.to_be_bytes(), unanswered)? else {
        return Ok(None);
    };
    if answer.first() != Some(&1) {
        return Err(Fault::Version);
    }
    let mut with_inertia = true;
    let recipe = loop {
        let fields = fields(settings, with_inertia);
        let request = recipe::request(&fields, settings.rate_hz);
        let unanswered = Fault::Unanswered("the request for outputs");
        let Some(answer) = peer.ask(OUTPUTS, &request, unanswered)? else {
            return Ok(None);
        };
        match Recipe::agreed(&answer, fields) {
            // Older controllers have a payload without an inertia.
            Err(Fault::NotFound(missing))
                if with_inertia && missing.iter().all(|field| field.part == Part::Inertia) =>
            {
                with_inertia = false;
            }
            other => break other?,
        }
    };
    let Some(answer) = peer.ask(START, &[], Fault::Unanswered("the request to begin"))? else {
        return Ok(None);
    };
    if answer.first() != Some(&1) {
        return Err(Fault::NotStarted);
    }
    Ok(Some(recipe))
}

/// The controller's side of a connection.
struct Peer<'a> {
    stream: TcpStream,
    packages: Packages,
    shared: &'a Shared,
}

impl<'a> Peer<'a> {
    fn new(stream: TcpStream, shared: &'a Shared) -> Result<Self, Fault> {
        let set = stream
            .set_nodelay(true)
            .and_then(|()| stream.set_read_timeout(Some(READ_FOR)))
            .and_then(|()| stream.set_write_timeout(Some(PATIENCE)));
        set.map_err(closed)?;
        Ok(Self {
            stream,
            packages: Packages::default(),
            shared,
        })
    }

    /// Sends a request and waits for its answer.
    fn ask(&mut self, letter: u8, body: &[u8], silent: Fault) -> Result<Option<Vec<u8>>, Fault> {
        let request = wire::package(letter, body);
        self.stream.write_all(&request).map_err(closed)?;
        self.next(letter, silent)
    }

    /// Returns the body of the next package with this letter; `None` at the stop. Logs texts and skips other
    /// packages.
    fn next(&mut self, wanted: u8, silent: Fault) -> Result<Option<Vec<u8>>, Fault> {
        let mut buffer = [0; 4096];
        let deadline = Instant::now() + PATIENCE;
        while !self.shared.is_stopped() {
            let nonsense = |nonsense: wire::Nonsense| Fault::Nonsense(nonsense.beginning);
            while let Some((letter, body)) = self.packages.take().map_err(nonsense)? {
                if letter == TEXT {
                    tracing::warn!("the controller says: {}", wire::text(&body));
                } else if letter == wanted {
                    return Ok(Some(body));
                }
            }
            if Instant::now() >= deadline {
                return Err(silent);
            }
            match self.stream.read(&mut buffer) {
                Ok(0) => return Err(Fault::Closed("end of the stream".to_owned())),
                Ok(count) => self.packages.push(&buffer[..count]),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {}
                    _ => return Err(closed(error)),
                },
            }
        }
        Ok(None)
    }
}

#[allow(
    clippy::needless_pass_by_value,
    reason = "map_err hands the error over"
)]
fn closed(error: std::io::Error) -> Fault {
    Fault::Closed(error.to_string())
}

/// Returns the current time on the clock of reception.
pub(super) fn now_ns() -> i64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos() as i64)
}
