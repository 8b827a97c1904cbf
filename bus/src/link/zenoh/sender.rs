//! The sending end over Zenoh.

use std::collections::HashSet;
use std::marker::PhantomData;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use zenoh::Wait as _;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind as Change;

use super::{Zenoh, encoding, open_error, policy, zenoh_reason};
use crate::link::{Audience, Keep, LinkError, Sender, SenderCounts};
use crate::sample::{Sample, flags};

pub(super) struct ZenohSender<T> {
    stream: String,
    publisher: Publisher<'static>,
    audience: Audience,
    presence: Arc<Presence>,
    _tokens: [Subscriber<()>; 2],
    _ends: Subscriber<()>,
    instance: u64,
    next: u64,
    /// Who was there when the end was sent.
    told: HashSet<String>,
    counts: SenderCounts,
    kind: PhantomData<T>,
}

/// What the sender hears of its receivers.
#[derive(Debug, Default)]
struct Presence {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    keep_all: HashSet<String>,
    keep_newest: HashSet<String>,
    /// Those that have taken the end.
    taken: HashSet<String>,
}

impl State {
    fn missing(&self, audience: Audience) -> usize {
        audience.keep_all.saturating_sub(self.keep_all.len())
            + audience.keep_newest.saturating_sub(self.keep_newest.len())
    }

    /// Those of `told` that are still there and have not taken the end.
    fn untaken(&self, told: &HashSet<String>) -> usize {
        let there = |id: &&String| self.keep_all.contains(*id) || self.keep_newest.contains(*id);
        told.difference(&self.taken).filter(there).count()
    }
}

impl Presence {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, f: impl FnOnce(&mut State)) {
        f(&mut self.lock());
        self.changed.notify_all();
    }

    /// Waits until `count` is 0 or for `timeout`, and returns it.
    fn wait(&self, timeout: Duration, count: impl Fn(&State) -> usize) -> usize {
        let (state, _) = self
            .changed
            .wait_timeout_while(self.lock(), timeout, |state| count(state) > 0)
            .unwrap_or_else(PoisonError::into_inner);
        count(&state)
    }
}

impl<T: Sample> ZenohSender<T> {
    pub(super) fn open(
        transport: &Zenoh,
        stream: &str,
        audience: Audience,
    ) -> Result<Self, LinkError> {
        let session = &transport.session;
        let failed = |error: zenoh::Error| open_error(stream, &error);
        let presence = Arc::new(Presence::default());
        let publisher = session
            .declare_publisher(stream.to_owned())
            .encoding(encoding(T::KIND))
            .congestion_control(CongestionControl::Block)
            .wait()
            .map_err(failed)?;
        let tokens = |keep| {
            let presence = Arc::clone(&presence);
            session
                .liveliness()
                .declare_subscriber(format!("{stream}/{}/*", policy(keep)))
                .history(true)
                .callback(move |token| {
                    let id = last_chunk(token.key_expr());
                    presence.change(|state| {
                        let ids = match keep {
                            Keep::All => &mut state.keep_all,
                            Keep::Newest => &mut state.keep_newest,
                        };
                        match token.kind() {
                            Change::Put => ids.insert(id),
                            Change::Delete => ids.remove(&id),
                        };
                    });
                })
                .wait()
                .map_err(failed)
        };
        let instance = transport.unique();
        let ended = Arc::clone(&presence);
        let ends = session
            .declare_subscriber(format!("{stream}/@end/*"))
            .callback(move |sample| {
                if *sample.payload().to_bytes() == instance.to_le_bytes() {
                    let id = last_chunk(sample.key_expr());
                    ended.change(|state| {
                        state.taken.insert(id);
                    });
                }
            })
            .wait()
            .map_err(failed)?;
        Ok(Self {
            stream: stream.to_owned(),
            publisher,
            audience,
            _tokens: [tokens(Keep::All)?, tokens(Keep::Newest)?],
            presence: Arc::clone(&presence),
            _ends: ends,
            instance,
            next: 0,
            told: HashSet::new(),
            counts: SenderCounts::default(),
            kind: PhantomData,
        })
    }

    fn send(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut sample = T::default();
        write(&mut sample);
        sample.header_mut().sequence = self.next;
        self.next += 1;
        let there = self.presence.lock().keep_all.len();
        self.counts.undelivered += self.audience.keep_all.saturating_sub(there) as u64;
        self.publisher
            .put(bytemuck::bytes_of(&sample))
            .attachment(self.instance.to_le_bytes())
            .wait()
            .map_err(|error| LinkError::Send {
                stream: self.stream.clone(),
                reason: zenoh_reason(&error),
            })
    }
}

impl<T: Sample> Sender<T> for ZenohSender<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.send(write)?;
        self.counts.sent += 1;
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        self.next += count;
    }

    fn end(&mut self) -> Result<(), LinkError> {
        {
            let state = self.presence.lock();
            self.told = state.keep_all.union(&state.keep_newest).cloned().collect();
        }
        self.send(&mut |sample| sample.header_mut().flags = flags::END)
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let audience = self.audience;
        Ok(self.presence.wait(timeout, |state| state.missing(audience)))
    }

    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let told = &self.told;
        Ok(self.presence.wait(timeout, |state| state.untaken(told)))
    }

    fn counts(&self) -> SenderCounts {
        self.counts
    }
}

fn last_chunk(key: &zenoh::key_expr::KeyExpr<'_>) -> String {
    key.as_str()
        .rsplit('/')
        .next()
        .unwrap_or_default()
        .to_owned()
}
