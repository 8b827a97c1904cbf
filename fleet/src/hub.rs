//! The fleet host: one Zenoh session, one thread that owns the wall, and snapshots for all readers.

mod keeping;
mod physics;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tauscope_bus::command::{Answer, AskError, Signed, ask_signed};
use tauscope_bus::{LinkError, ZenohEndpoints};
use tokio::sync::watch;
use zenoh::Session;
use zenoh::Wait as _;
use zenoh::sample::SampleKind;

use crate::inbox;
use crate::keeper::{Deed, Keeper};
use crate::mailbox::Mailbox;
use crate::physics::CellPhysics;
use crate::store::{Label, Note, Store, StoreError};
use crate::wall::{Effect, Event, Now, Snapshot, Wall};
use keeping::Keeping;

/// Update interval of the snapshots. Resolution: an observer does not notice a shorter delay.
const SHOW_EVERY: Duration = Duration::from_millis(250);
/// Period at which the wall checks its timeouts. Resolution: a lost cell is detected within 1 s.
const TICK: Duration = Duration::from_millis(250);
/// Timeout of a query to a cell.
const ASK_WITHIN: Duration = Duration::from_secs(5);
/// Timeout of a command to a cell; the cell itself rejects a command after 1 s.
const COMMAND_WITHIN: Duration = Duration::from_secs(3);

/// Settings of a fleet host.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Zenoh endpoints through which the cells are reached.
    pub endpoints: ZenohEndpoints,
    /// Expected cells, which are shown before they connect.
    pub expected: Vec<String>,
    /// File of incidents and history; `None` to store none.
    pub store: Option<PathBuf>,
    /// The folder of the nightly tables of `tauscope physics`.
    pub physics: Option<PathBuf>,
}

/// An error of starting a fleet host.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A Zenoh session that cannot listen or connect.
    #[error(transparent)]
    Session(#[from] LinkError),
    /// A key that Zenoh rejects.
    #[error("zenoh: {0}")]
    Zenoh(String),
    /// A store that cannot be opened.
    #[error("cannot keep incidents: {0}")]
    Store(#[from] StoreError),
    /// A thread that cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

impl FleetError {
    #[expect(
        clippy::needless_pass_by_value,
        reason = "so that it maps an error as it is"
    )]
    fn zenoh(error: zenoh::Error) -> Self {
        Self::Zenoh(tauscope_bus::zenoh_reason(&error))
    }
}

/// An item in the queue of the hub's thread.
#[derive(Debug)]
enum Mail {
    Event(Event),
    Deed(Deed),
}

/// A fleet host that runs until it is dropped.
pub struct Hub {
    session: Session,
    mailbox: Arc<Mailbox<Mail>>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    store: Option<Mutex<Store>>,
    physics: Arc<Mutex<Vec<CellPhysics>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Hub {
    /// Starts listening to the cells.
    ///
    /// # Errors
    /// If the session or the file cannot be opened.
    pub fn start(options: &Options) -> Result<Self, FleetError> {
        let store = options.store.as_deref().map(Store::open).transpose()?;
        let reader = store.as_ref().map(Store::again).transpose()?;
        let mut wall = Wall::new(options.expected.iter().cloned());
        let mut keeper = store.map(Keeper::new);
        if let Some(keeper) = &mut keeper {
            let remembered = keeper.remembered()?;
            keeper.learn(
                remembered.iter().map(|known| known.cell.as_str()),
                unix_ns(),
            )?;
            for known in remembered {
                let latched = keeper.store().latched(&known.cell)?;
                wall.remember(known, latched);
            }
        }
        let begin = Instant::now();
        wall.tick(Now {
            running_ms: 0,
            unix_ns: unix_ns(),
        });
        let session = options.endpoints.session()?;
        let mailbox = Arc::new(Mailbox::default());
        listen(&session, &mailbox)?;
        let (show, snapshots) = watch::channel(Arc::new(wall.snapshot()));
        let stop = Arc::new(AtomicBool::new(false));
        let physics = Arc::new(Mutex::new(Vec::new()));
        if let Some(folder) = options.physics.clone() {
            let notes = reader.as_ref().map(Store::again).transpose()?;
            let (physics, stop) = (physics.clone(), stop.clone());
            let thread = std::thread::Builder::new().name("fleet-physics".to_owned());
            thread.spawn(move || physics::follow(&folder, notes.as_ref(), &physics, &stop))?;
        }
        let worker = Worker {
            session: session.clone(),
            mailbox: mailbox.clone(),
            wall,
            keeper: keeper.map(Keeping::new),
            physics: physics.clone(),
            show,
            begin,
        };
        let stopped = stop.clone();
        let thread = std::thread::Builder::new().name("fleet".to_owned());
        let thread = thread.spawn(move || worker.work(&stopped))?;
        Ok(Self {
            session,
            mailbox,
            snapshots,
            store: reader.map(Mutex::new),
            physics,
            stop,
            thread: Some(thread),
        })
    }

    /// Returns the newest snapshot.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        self.snapshots.borrow().clone()
    }

    /// Returns a receiver of the snapshots.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.clone()
    }

    /// Reads from the store. Returns `None` without a store.
    pub fn kept<T>(
        &self,
        read: impl FnOnce(&Store) -> Result<T, StoreError>,
    ) -> Option<Result<T, StoreError>> {
        let store = self.store.as_ref()?;
        // A reader that panicked has changed nothing.
        let store = store.lock().unwrap_or_else(PoisonError::into_inner);
        Some(read(&store))
    }

    /// Returns the physics of a cell's arm over weeks, if its nightly tables are read.
    pub fn physics(&self, cell: &str) -> Option<CellPhysics> {
        let known = self.physics.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().find(|physics| physics.cell == cell).cloned()
    }

    /// Sends a command to a cell, as `tauscope send` does, and waits for its answer.
    ///
    /// # Errors
    /// If the cell does not answer.
    pub fn send(&self, cell: &str, signed: &Signed) -> Result<Answer, AskError> {
        ask_signed(&self.session, cell, signed, COMMAND_WITHIN)
    }

    /// Stores that a user has acknowledged the open incidents of a cell.
    pub fn acknowledged(&self, cell: &str, by: &str) {
        let (cell, by) = (cell.to_owned(), by.to_owned());
        self.mailbox
            .urgent(Mail::Deed(Deed::Acknowledged { cell, by }));
    }

    /// Stores a user's note on a cell.
    pub fn note(&self, cell: &str, note: Note) {
        let cell = cell.to_owned();
        self.mailbox.urgent(Mail::Deed(Deed::Noted { cell, note }));
    }

    /// Stores a user's label that a cell has written to its archive.
    pub fn labelled(&self, cell: &str, label: Label) {
        let cell = cell.to_owned();
        self.mailbox
            .urgent(Mail::Deed(Deed::Labelled { cell, label }));
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic has already been reported.
            let _ = thread.join();
        }
        // Nothing is left to be sent.
        let _ = self.session.close().wait();
    }
}

fn unix_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    })
}

/// Subscribes to the tokens, statuses and records of all cells.
fn listen(session: &Session, mailbox: &Arc<Mailbox<Mail>>) -> Result<(), FleetError> {
    let tokens = mailbox.clone();
    session
        .liveliness()
        .declare_subscriber("*/@alive/*")
        .history(true)
        .callback(move |sample| {
            let event = match (inbox::token(sample.key_expr().as_str()), sample.kind()) {
                (None, _) => Event::Refused("token that names no cell"),
                (Some((cell, instance)), SampleKind::Put) => Event::Alive { cell, instance },
                (Some((cell, instance)), SampleKind::Delete) => Event::Gone { cell, instance },
            };
            tokens.urgent(Mail::Event(event));
        })
        .background()
        .wait()
        .map_err(FleetError::zenoh)?;
    for (key, read) in [
        ("*/status", inbox::status as fn(&str, &[u8]) -> Event),
        ("*/records", inbox::record),
    ] {
        let mailbox = mailbox.clone();
        session
            .declare_subscriber(key)
            .callback(move |sample| {
                let event = read(sample.key_expr().as_str(), &sample.payload().to_bytes());
                mailbox.ordinary(Mail::Event(event));
            })
            .background()
            .wait()
            .map_err(FleetError::zenoh)?;
    }
    Ok(())
}

/// Parser of a cell's answer: key, payload, and the times of the query and of the answer \[ns since the epoch\].
type Read = fn(&str, &[u8], [i64; 2]) -> Vec<Event>;

/// State of the hub's thread.
struct Worker {
    session: Session,
    mailbox: Arc<Mailbox<Mail>>,
    wall: Wall,
    keeper: Option<Keeping>,
    physics: Arc<Mutex<Vec<CellPhysics>>>,
    show: watch::Sender<Arc<Snapshot>>,
    begin: Instant,
}

impl Worker {
    fn work(mut self, stopped: &AtomicBool) {
        let (mut ticked, mut shown) = (None::<Instant>, None::<Instant>);
        while !stopped.load(Ordering::Relaxed) {
            let (mail, overflowed) = self.mailbox.take(TICK);
            for _ in 0..overflowed {
                self.tell(Event::Refused("more messages than the fleet host takes"));
            }
            for mail in mail {
                self.open(mail);
            }
            if ticked.is_none_or(|ticked| ticked.elapsed() >= TICK) {
                ticked = Some(Instant::now());
                let reached = self.reached();
                self.tell(Event::Reached(reached));
            }
            if shown.is_none_or(|shown| shown.elapsed() >= SHOW_EVERY) {
                shown = Some(Instant::now());
                self.show();
            }
        }
    }

    fn open(&mut self, mail: Mail) {
        match (mail, &mut self.keeper) {
            (Mail::Event(event), _) => self.tell(event),
            (Mail::Deed(deed), Some(keeping)) => keeping.take(&self.wall, deed, unix_ns()),
            (Mail::Deed(_), None) => {}
        }
    }

    fn tell(&mut self, event: Event) {
        let now = self.now();
        for effect in self.wall.take(event, now) {
            self.ask(&effect);
            if let Some(keeping) = &mut self.keeper {
                keeping.keep(&self.wall, effect, now.unix_ns);
            }
        }
    }

    fn show(&mut self) {
        let mut snapshot = self.wall.snapshot();
        if let Some(keeping) = &mut self.keeper {
            keeping.tick(&self.wall, &mut snapshot);
        }
        let known = self.physics.lock().unwrap_or_else(PoisonError::into_inner);
        for view in &mut snapshot.cells {
            let own = known.iter().find(|physics| physics.cell == view.cell);
            view.drift = own.and_then(|physics| physics.drift(snapshot.now_ns));
        }
        drop(known);
        // There may be no receiver now.
        self.show.send_replace(Arc::new(snapshot));
    }

    /// Queries a cell for missing data; the answer goes to the mailbox.
    fn ask(&self, effect: &Effect) {
        let (selector, read): (String, Read) = match effect {
            Effect::AskStatus { cell } => (format!("{cell}/status"), |key, payload, _| {
                vec![inbox::answer(key, payload)]
            }),
            Effect::AskRecords { cell, after } => (
                format!("{cell}/records?after={after}"),
                |key, payload, _| inbox::records(key, payload),
            ),
            Effect::AskClock { cell } => (format!("{cell}/status?clock"), |key, payload, times| {
                let [asked_ns, back_ns] = times;
                let event = inbox::clock(key, payload, asked_ns, back_ns);
                event.into_iter().collect()
            }),
            _ => return,
        };
        let (asked_ns, begin) = (unix_ns(), Instant::now());
        let mailbox = self.mailbox.clone();
        let asked = self
            .session
            .get(selector)
            .timeout(ASK_WITHIN)
            .callback(move |reply| {
                let Ok(sample) = reply.result() else { return };
                // This host's clock may be set meanwhile.
                let took_ns = i64::try_from(begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
                let times = [asked_ns, asked_ns.saturating_add(took_ns)];
                let payload = sample.payload().to_bytes();
                for event in read(sample.key_expr().as_str(), &payload, times) {
                    mailbox.ordinary(Mail::Event(event));
                }
            })
            .wait();
        if let Err(error) = asked {
            tracing::warn!("{}", FleetError::zenoh(error));
        }
    }

    /// Returns the number of connected Zenoh sessions.
    fn reached(&self) -> usize {
        let info = self.session.info();
        info.routers_zid().wait().count() + info.peers_zid().wait().count()
    }

    fn now(&self) -> Now {
        Now {
            running_ms: u64::try_from(self.begin.elapsed().as_millis()).unwrap_or(u64::MAX),
            unix_ns: unix_ns(),
        }
    }
}
