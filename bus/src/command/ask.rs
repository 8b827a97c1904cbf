//! Asking the source of a cell to take a command.

use std::time::{Duration, Instant};

use zenoh::Wait as _;
use zenoh::bytes::Encoding;

use super::{Answer, Request, Signed, key};

/// Nobody answers yet: how long until the question is put again. A session that was just opened is not connected yet.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// Nobody takes commands there.
    #[error(
        "nobody takes commands for the cell `{cell}`; does its pipeline run, and has its `ingest` a `commands`?"
    )]
    Nobody {
        /// The cell.
        cell: String,
    },
    /// Zenoh does not take the question.
    #[error("cannot ask the cell `{cell}`: {reason}")]
    Zenoh {
        /// The cell.
        cell: String,
        /// What Zenoh says.
        reason: String,
    },
    /// What came back is no answer.
    #[error("the answer of the cell `{cell}` cannot be read: {reason}")]
    Unreadable {
        /// The cell.
        cell: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Asks the source of `cell` to take a command, and waits for its answer for at most `patience`.
///
/// # Errors
/// If nobody answers, or not with an [`Answer`].
pub fn ask(
    session: &zenoh::Session,
    cell: &str,
    request: &Request,
    patience: Duration,
) -> Result<Answer, AskError> {
    let request = request.clone();
    ask_signed(session, cell, &Signed { request, by: None }, patience)
}

/// As [`ask`], with the name of who asks.
///
/// # Errors
/// As [`ask`].
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
