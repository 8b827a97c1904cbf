//! Notifications to a service manager (`sd_notify(3)`): readiness, status, watchdog and end of the run. Without a
//! service manager none are sent.

use std::time::Duration;

use sd_notify::NotifyState;
use tokio::time::Instant;

/// State of the notifications.
#[derive(Debug)]
pub struct Service {
    /// Interval of watchdog notifications: half of systemd's limit, as its manual recommends.
    beat_every: Option<Duration>,
    beat: Option<Instant>,
    ready: bool,
    status: String,
}

impl Service {
    /// Reads the watchdog limit that systemd has set.
    pub fn new() -> Self {
        Self {
            beat_every: sd_notify::watchdog_enabled().map(|limit| limit / 2),
            beat: None,
            ready: false,
            status: String::new(),
        }
    }

    /// Sends the notifications that are due. Called from the supervisor's loop: if that hangs, no notification is
    /// sent, and systemd ends the run.
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

/// Notifies that the run ends.
pub fn ends() {
    send(&[NotifyState::Stopping]);
}

fn send(state: &[NotifyState<'_>]) {
    // A failed notification does not affect the run.
    let _ = sd_notify::notify(state);
}
