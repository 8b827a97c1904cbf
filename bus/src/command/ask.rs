//! Client side of commands: sends a request to the source of a cell and waits for its answer.

use std::time::{Duration, Instant};

use zenoh::Wait as _;
use zenoh::bytes::Encoding;

use super::{Answer, Request, Signed, key};

/// Retry interval while there is no answer: a session that was just opened is not connected yet.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// Failure to get an answer from a cell.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// No source accepts commands for the cell.
    #[error(
        "no source accepts commands for the cell `{cell}`; is its pipeline running, and does its `ingest` have `commands`?"
    )]
    Nobody {
        /// Name of the cell.
        cell: String,
    },
    /// Query rejected by Zenoh.
    #[error("cannot ask the cell `{cell}`: {reason}")]
    Zenoh {
        /// Name of the cell.
        cell: String,
        /// Error message of Zenoh.
        reason: String,
    },
    /// Error reply, or a reply that is not an [`Answer`].
    #[error("the answer of the cell `{cell}` cannot be read: {reason}")]
    Unreadable {
        /// Name of the cell.
        cell: String,
        /// Cause.
        reason: String,
    },
}

/// Sends `request` to the source of `cell` and waits at most `patience` for the answer.
///
/// # Errors
/// If no source answers, or the reply is not an [`Answer`].
pub fn ask(
    session: &zenoh::Session,
    cell: &str,
    request: &Request,
    patience: Duration,
) -> Result<Answer, AskError> {
    let request = request.clone();
    ask_signed(session, cell, &Signed { request, by: None }, patience)
}

/// Like [`ask`], with the name of the requester.
///
/// # Errors
/// See [`ask`].
pub fn ask_signed(
    session: &zenoh::Session,
    cell: &str,
    signed: &Signed,
    patience: Duration,
) -> Result<Answer, AskError> {
    let zenoh = |reason: String| AskError::Zenoh {
        cell: cell.to_owned(),
        reason,
    };
    let unreadable = |reason: String| AskError::Unreadable {
        cell: cell.to_owned(),
        reason,
    };
    let json = signed.to_json().map_err(|error| zenoh(error.to_string()))?;
    let deadline = Instant::now() + patience;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let replies = session
            .get(key(cell))
            .payload(json.as_str())
            .encoding(Encoding::APPLICATION_JSON)
            .timeout(left.max(AGAIN_AFTER))
            .wait()
            .map_err(|error| zenoh(error.to_string()))?;
        if let Ok(reply) = replies.recv() {
            return match reply.result() {
                Ok(sample) => serde_json::from_slice(&sample.payload().to_bytes())
                    .map_err(|error| unreadable(error.to_string())),
                Err(error) => Err(unreadable(
                    String::from_utf8_lossy(&error.payload().to_bytes()).into_owned(),
                )),
            };
        }
        if Instant::now() + AGAIN_AFTER >= deadline {
            return Err(AskError::Nobody {
                cell: cell.to_owned(),
            });
        }
        std::thread::sleep(AGAIN_AFTER);
    }
}
