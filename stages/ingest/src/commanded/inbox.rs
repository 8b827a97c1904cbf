//! Bounded inbox of commands received over Zenoh.
//!
//! A query (`get`) is answered once a sample carries the command, or once the command is refused. A message (`put`)
//! is accepted too, but not answered.

use std::collections::VecDeque;
use std::sync::mpsc::{self, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tauscope_bus::command::{self, Answer, Refusal, Signed};
use tauscope_bus::{Command, LinkError, Verb, ZenohEndpoints};
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::query::Query;
use zenoh::{Session, Wait as _};

use super::Takes;
use crate::setup::Setup;

/// Maximum number of commands that wait for a sample.
const CAPACITY: usize = 64;
/// Timeout after which a waiting command is refused: it must not take effect when its sender no longer expects it.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Maximum size of a request \[bytes\].
const MAX_PAYLOAD_BYTES: usize = 4096;

/// A command that waits for a sample.
pub(super) struct Waiting {
    pub command: Command,
    question: Option<Query>,
    since: Instant,
}

type Queue = Arc<Mutex<VecDeque<Waiting>>>;
type Answers = SyncSender<(Query, Answer)>;

/// Receiver of commands over Zenoh.
pub(super) struct Inbox {
    /// Keeps the declarations alive.
    _session: Session,
    queue: Queue,
    answers: Answers,
}

impl Inbox {
    pub fn open(
        endpoints: &ZenohEndpoints,
        setup: &Setup,
        takes: Takes,
    ) -> Result<Self, LinkError> {
        let key = command::key(&setup.cell);
        let failed = |error: zenoh::Error| LinkError::Open {
            stream: key.clone(),
            transport: "zenoh",
            reason: error.to_string(),
        };
        let session = endpoints.session()?;
        let queue = Queue::default();
        // Replies have a thread of their own: a slow client blocks them, and samples must not wait for it.
        let (answers, to_answer) = mpsc::sync_channel::<(Query, Answer)>(CAPACITY);
        std::thread::spawn(move || {
            for (question, answer) in to_answer {
                reply(&question, &answer);
            }
        });
        let door = Door {
            queue: queue.clone(),
            answers: answers.clone(),
            has_tool_link: setup.has_tool_link,
            takes,
        };
        let other_door = door.clone();
        session
            .declare_queryable(key.clone())
            .callback(move |question| {
                let payload = question.payload().cloned().unwrap_or_default();
                door.enter(&payload, Some(question));
            })
            .background()
            .wait()
            .map_err(failed)?;
        session
            .declare_subscriber(key.clone())
            .callback(move |message| other_door.enter(message.payload(), None))
            .background()
            .wait()
            .map_err(failed)?;
        Ok(Self {
            _session: session,
            queue,
            answers,
        })
    }

    /// Removes and returns the command that has waited longest.
    pub fn pop(&mut self) -> Option<Waiting> {
        lock(&self.queue).pop_front()
    }

    pub fn answer(&self, waiting: Waiting, answer: Answer) {
        answer_to(&self.answers, waiting.question, answer);
    }

    pub fn refuse_what_waits_too_long(&mut self) {
        loop {
            let mut queue = lock(&self.queue);
            let late = |waiting: &Waiting| waiting.since.elapsed() > LONGEST_WAIT;
            if !queue.front().is_some_and(late) {
                return;
            }
            let waiting = queue.pop_front();
            drop(queue);
            if let Some(waiting) = waiting {
                let reason = format!(
                    "no joint state came within {} s that could take it; ask again when the robot is heard",
                    LONGEST_WAIT.as_secs()
                );
                self.answer(waiting, Answer::Refused { reason });
            }
        }
    }
}

/// Checks requests, on Zenoh's threads, and puts them into the queue.
#[derive(Clone)]
struct Door {
    queue: Queue,
    answers: Answers,
    has_tool_link: bool,
    takes: Takes,
}

impl Door {
    fn enter(&self, payload: &ZBytes, question: Option<Query>) {
        let reason = match self.check(payload) {
            Ok(command) => {
                let mut queue = lock(&self.queue);
                if queue.len() < CAPACITY {
                    queue.push_back(Waiting {
                        command,
                        question,
                        since: Instant::now(),
                    });
                    return;
                }
                format!("{CAPACITY} commands wait already; ask again later")
            }
            Err(reason) => reason,
        };
        answer_to(&self.answers, question, Answer::Refused { reason });
    }

    fn check(&self, payload: &ZBytes) -> Result<Command, String> {
        let say = |refusal: Refusal| refusal.to_string();
        if payload.len() > MAX_PAYLOAD_BYTES {
            return Err(format!(
                "{} bytes are too many for a command",
                payload.len()
            ));
        }
        let request = Signed::from_json(&payload.to_bytes()).map_err(say)?;
        let command = request.command().map_err(say)?;
        if command.verb() == Some(Verb::Payload) && !self.has_tool_link {
            return Err(
                "it is not known which link carries a tool; give the cell a `tool` with its `link`"
                    .to_owned(),
            );
        }
        if command.verb() == Some(Verb::Learn) && !self.takes.learn {
            return Err(
                "no detector of this cell learns while it runs; `virtual_collision_sensor` does. \
                 What `tauscope` has learnt is learnt anew by `tauscope init`"
                    .to_owned(),
            );
        }
        let arm_kg = self.takes.arm_kg.filter(|arm_kg| command.value > *arm_kg);
        if let Some(arm_kg) = arm_kg.filter(|_| command.verb() == Some(Verb::Payload)) {
            return Err(format!(
                "no arm carries {} kg that itself weighs {arm_kg:.1} kg, as its URDF says",
                command.value
            ));
        }
        Ok(command)
    }
}

/// Passes the answer to the thread that replies; without a query, logs a refusal.
fn answer_to(answers: &Answers, question: Option<Query>, answer: Answer) {
    match (question, answer) {
        (Some(question), answer) => {
            if answers.try_send((question, answer)).is_err() {
                tracing::warn!("an answer to a command was dropped: its client is too slow");
            }
        }
        (None, Answer::Refused { reason }) => tracing::warn!("a command was refused: {reason}"),
        (None, Answer::Taken { .. }) => {}
    }
}

fn reply(question: &Query, answer: &Answer) {
    let sent = serde_json::to_string(answer)
        .map_err(|error| error.to_string())
        .and_then(|json| {
            question
                .reply(question.key_expr().clone(), json)
                .encoding(Encoding::APPLICATION_JSON)
                .wait()
                .map_err(|error| error.to_string())
        });
    if let Err(reason) = sent {
        tracing::warn!("a command cannot be answered: {reason}");
    }
}

// No code panics while it holds the lock, so a poisoned lock still guards a consistent queue.
fn lock(queue: &Queue) -> MutexGuard<'_, VecDeque<Waiting>> {
    queue.lock().unwrap_or_else(PoisonError::into_inner)
}
