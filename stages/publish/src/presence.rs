//! The cell's presence in a fleet: a liveliness token, the newest status and the newest records, over Zenoh.
//!
//! | key | what |
//! | --- | --- |
//! | `<cell>/@alive/<instance>` | liveliness token, which disappears with the process |
//! | `<cell>/status` | [`StatusMessage`] once a second; a query returns the newest, with `clock` a [`ClockMessage`] |
//! | `<cell>/records` | [`RecordMessage`] as it occurs; a query with `after=NUMBER` returns those after that number |

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait as _};

use crate::error::PublishError;
use crate::message::{ClockMessage, RecordMessage, StatusMessage};

/// Number of records kept for queries. Resolution: hours of contacts, and an answer below 100 kB.
const MAX_RECORDS: usize = 256;

/// Returns the key of a cell's liveliness token.
pub fn alive_key(cell: &str, instance: &str) -> String {
    format!("{cell}/@alive/{instance}")
}

#[derive(Debug, Default)]
struct Kept {
    status: Option<String>,
    /// Number and text.
    records: VecDeque<(u64, String)>,
}

/// A cell's presence; it ends when this is dropped.
pub struct Presence {
    status: Publisher<'static>,
    records: Publisher<'static>,
    kept: Arc<Mutex<Kept>>,
    _queryables: [Queryable<()>; 2],
    _token: LivelinessToken,
    /// Keeps the session open.
    _session: Session,
}

impl Presence {
    /// Announces the run `instance` of a publisher of `cell`.
    ///
    /// # Errors
    /// If Zenoh rejects a key.
    pub fn open(session: &Session, cell: &str, instance: &str) -> Result<Self, PublishError> {
        let kept = Arc::new(Mutex::new(Kept::default()));
        let (status, records) = (format!("{cell}/status"), format!("{cell}/records"));
        let publisher = |key: &str| {
            session
                .declare_publisher(key.to_owned())
                .congestion_control(CongestionControl::Drop)
                .encoding(Encoding::APPLICATION_JSON)
                .wait()
                .map_err(PublishError::zenoh)
        };
        let answer = |key: &str, text: fn(&Kept, &Query) -> Option<String>| {
            let (kept, own) = (kept.clone(), key.to_owned());
            let instance = instance.to_owned();
            session
                .declare_queryable(key.to_owned())
                .callback(move |query| {
                    let text = if query.parameters().contains_key("clock") {
                        clock(&instance)
                    } else {
                        text(&lock(&kept), &query)
                    };
                    if let Some(text) = text {
                        // Fails if the client has disconnected.
                        let _ = query
                            .reply(own.clone(), text)
                            .encoding(Encoding::APPLICATION_JSON)
                            .wait();
                    }
                })
                .wait()
                .map_err(PublishError::zenoh)
        };
        Ok(Self {
            status: publisher(&status)?,
            records: publisher(&records)?,
            _queryables: [
                answer(&status, |kept, _| kept.status.clone())?,
                answer(&records, |kept, query| Some(behind(kept, query)))?,
            ],
            kept: kept.clone(),
            _token: session
                .liveliness()
                .declare_token(alive_key(cell, instance))
                .wait()
                .map_err(PublishError::zenoh)?,
            _session: session.clone(),
        })
    }

    /// Publishes the status of the cell.
    ///
    /// # Errors
    /// If the message cannot be sent.
    pub fn status(&self, message: &StatusMessage) -> Result<(), PublishError> {
        let text = serde_json::to_string(message)?;
        lock(&self.kept).status = Some(text.clone());
        self.status.put(text).wait().map_err(PublishError::zenoh)
    }

    /// Publishes a record.
    ///
    /// # Errors
    /// If the message cannot be sent; it is kept for a query nevertheless.
    pub fn record(&self, message: &RecordMessage) -> Result<(), PublishError> {
        let text = serde_json::to_string(message)?;
        {
            let mut kept = lock(&self.kept);
            if kept.records.len() == MAX_RECORDS {
                kept.records.pop_front();
            }
            kept.records.push_back((message.number, text.clone()));
        }
        self.records.put(text).wait().map_err(PublishError::zenoh)
    }
}

/// Returns the time by the clock of this computer \[ns since the epoch\].
pub fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
    })
}

/// Returns the answer to a query of the clock.
fn clock(instance: &str) -> Option<String> {
    let received_ns = now_ns();
    let message = ClockMessage {
        instance: instance.to_owned(),
        received_ns,
        answered_ns: received_ns,
    };
    serde_json::to_string(&message).ok()
}

/// Returns the records after the number that a query names, as a JSON array.
fn behind(kept: &Kept, query: &Query) -> String {
    let after: u64 = query
        .parameters()
        .get("after")
        .and_then(|number| number.parse().ok())
        .unwrap_or(0);
    let behind = kept.records.iter().filter(|(number, _)| *number > after);
    let texts: Vec<&str> = behind.map(|(_, text)| text.as_str()).collect();
    format!("[{}]", texts.join(","))
}

/// Locks the messages, even if poisoned: each of them is consistent at any time.
fn lock(kept: &Mutex<Kept>) -> MutexGuard<'_, Kept> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}
