//! What a service manager is told (`sd_notify(3)`): when the run is ready, how it fares, that it lives, and that it ends.
//! Where none listens nothing is told.

use std::time::Duration;

use sd_notify::NotifyState;
use tokio::time::Instant;

/// The service that this run is, if it is one.
#[derive(Debug)]
pub struct Service {
    /// How often it must be told that the run lives; half of what systemd allows, as its manual asks for.
    beat_every: Option<Duration>,
    beat: Option<Instant>,
    ready: bool,
    status: String,
}

impl Service {
    /// As systemd has started it.
    pub fn new() -> Self {
        Self {
            beat_every: sd_notify::watchdog_enabled().map(|limit| limit / 2),
            beat: None,
            ready: false,
            status: String::new(),
        }
    }

    /// The run has got so far. Called from the loop that looks after the stages: a loop that hangs tells nothing, and
    /// systemd ends the run.
    pub fn tell(&mut self, ready: bool, status: String, now: Instant) {
        if ready && !self.ready {
            self.ready = true;
            send(&[NotifyState::Ready]);
        }
        if status != self.status {
            send(&[NotifyState::Status(&status)]);
            self.status = status;
        }
        let Some(every) = self.beat_every else { return };
        if self
            .beat
            .is_none_or(|beat| now.duration_since(beat) >= every)
        {
            self.beat = Some(now);
            send(&[NotifyState::Watchdog]);
        }
    }
}

/// The run ends.
pub fn ends() {
    send(&[NotifyState::Stopping]);
}

fn send(state: &[NotifyState<'_>]) {
    // A manager that does not listen misses what it asked for; the run goes on.
    let _ = sd_notify::notify(state);
}
