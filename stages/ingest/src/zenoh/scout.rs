//! Observes the other traffic of a session while the expected messages do not arrive.
//!
//! For a short time it subscribes to everything, which may be much (cameras), queries the tokens with which ROS 2
//! announces its publishers, and tries the endpoints that cannot be reached. Then it pauses for longer than it
//! looked.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use zenoh::pubsub::Subscriber;
use zenoh::{Session, Wait};

use super::attachment::Attachment;
use super::publication::Publications;
use crate::tcp;

/// Duration of a look.
const LOOK_FOR: Duration = Duration::from_millis(1500);
/// Interval between the starts of two looks.
const LOOK_EVERY: Duration = Duration::from_secs(10);
/// Timeout for the answer of an endpoint.
const ANSWER_WITHIN: Duration = Duration::from_millis(1500);
/// Key expression of all keys except the administrative ones of Zenoh and ROS 2.
const EVERYTHING: &str = "**";
/// Tokens of `rmw_zenoh` and of `zenoh-bridge-ros2dds`.
const TOKENS: [&str; 2] = ["@ros2_lv/**", "@/*/@ros2_lv/**"];

/// Result of a look.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    /// Publications on the session.
    pub publications: Publications,
    /// Endpoints that were tried, each with the reason of its failure; `None` for those that answered.
    pub endpoints: Vec<(String, Option<String>)>,
    /// Number of routers and peers that the session is connected to.
    pub connected: usize,
}

/// Observer of a session.
#[derive(Debug)]
pub(super) struct Scout {
    endpoints: Vec<String>,
    found: Arc<Mutex<Seen>>,
    /// Whether a thread is trying the endpoints; there is never more than one.
    trying: Arc<AtomicBool>,
    look: Option<Look>,
    began: Option<Instant>,
    /// Result of the last complete look.
    newest: Option<Seen>,
}

/// A look in progress; it subscribes to everything until it is dropped.
#[derive(Debug)]
struct Look {
    began: Instant,
    _everything: Option<Subscriber<()>>,
}

impl Scout {
    /// Creates a scout for a session that connects to these endpoints.
    pub fn new(endpoints: &[String]) -> Self {
        Self {
            endpoints: endpoints.to_vec(),
            found: Arc::default(),
            trying: Arc::default(),
            look: None,
            began: None,
            newest: None,
        }
    }

    /// Starts a look if one is due, and ends a look whose time is over; returns the newest result.
    pub fn look(&mut self, session: &Session) -> Option<&Seen> {
        let now = Instant::now();
        if let Some(look) = &self.look
            && now.duration_since(look.began) >= LOOK_FOR
        {
            self.look = None;
            let mut seen = lock(&self.found).clone();
            seen.connected = connected(session);
            self.newest = Some(seen);
        }
        // A new or lost connection changes the observable traffic.
        let had_connection = self.newest.as_ref().map(|seen| seen.connected > 0);
        let changed = had_connection.is_some_and(|had| had != (connected(session) > 0));
        let is_due = |began: Instant| changed || now.duration_since(began) >= LOOK_EVERY;
        if self.look.is_none() && self.began.is_none_or(is_due) {
            self.began = Some(now);
            self.look = Some(self.begin(session, now));
        }
        self.newest.as_ref()
    }

    /// Stops looking and discards the results, while the source has samples.
    pub fn rest(&mut self) {
        self.look = None;
        self.began = None;
        self.newest = None;
    }

    fn begin(&self, session: &Session, now: Instant) -> Look {
        *lock(&self.found) = Seen::default();
        if connected(session) == 0 {
            self.try_endpoints();
        }
        for tokens in TOKENS {
            let found = Arc::clone(&self.found);
            let asked = session
                .liveliness()
                .get(tokens)
                .timeout(LOOK_FOR)
                .callback(move |reply| {
                    if let Ok(token) = reply.result() {
                        lock(&found)
                            .publications
                            .announce(token.key_expr().as_str());
                    }
                });
            // It fails only without a connection, which the result reports.
            let _ = asked.wait();
        }
        let found = Arc::clone(&self.found);
        let everything = session
            .declare_subscriber(EVERYTHING)
            .callback(move |sample| {
                let bytes = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
                let attachment = bytes.and_then(|bytes| Attachment::parse(&bytes));
                let (key, payload) = (sample.key_expr().as_str(), sample.payload().to_bytes());
                lock(&found).publications.hear(key, &payload, attachment);
            });
        Look {
            began: now,
            _everything: everything.wait().ok(),
        }
    }

    /// Tries the endpoints in a thread of its own, since resolving names may take long.
    fn try_endpoints(&self) {
        if self.trying.swap(true, Ordering::Relaxed) {
            return;
        }
        let (endpoints, found) = (self.endpoints.clone(), Arc::clone(&self.found));
        let trying = Arc::clone(&self.trying);
        std::thread::spawn(move || {
            for endpoint in endpoints {
                let fault = fault_of(&endpoint);
                lock(&found).endpoints.push((endpoint, fault));
            }
            trying.store(false, Ordering::Relaxed);
        });
    }
}

/// Returns the number of routers and peers that a session is connected to.
pub(super) fn connected(session: &Session) -> usize {
    let info = session.info();
    info.peers_zid().wait().count() + info.routers_zid().wait().count()
}

/// Returns the reason why an endpoint such as `tcp/10.0.0.1:7447` cannot be reached, if it cannot.
fn fault_of(endpoint: &str) -> Option<String> {
    let (_, address) = endpoint.split_once('/')?;
    let address = address.split(['?', '#']).next().unwrap_or(address);
    let reached = tcp::connect(address, ANSWER_WITHIN);
    reached.err().map(|fault| fault.to_string())
}

/// Locks the result, even if poisoned: no operation on it can be left half done.
fn lock(found: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    found.lock().unwrap_or_else(PoisonError::into_inner)
}
