//! Since when a cell is latched.

use tauscope_publish::message::{AlarmMessage, AlarmState};

const NS_PER_MS: i64 = 1_000_000;

/// A latched alarm, as long as nobody has told that it is released: a cell that is stale meanwhile is still latched.
#[derive(Debug, Default)]
pub struct Latch {
    /// Since when \[ns since the epoch\].
    since_ns: Option<i64>,
    /// The publisher's life that told so.
    instance: String,
    /// Since when it was latched in an earlier life of the publisher, which does not know that any more.
    before_ns: Option<i64>,
}

impl Latch {
    /// What is known from an earlier life of the fleet host: the publisher's life that was latched, and since when
    /// \[ns since the epoch\].
    pub fn remember(&mut self, latched: Option<(String, i64)>) {
        let Some((instance, since_ns)) = latched else {
            return;
        };
        *self = Self {
            since_ns: Some(since_ns),
            instance,
            before_ns: None,
        };
    }

    /// Since when it is latched \[ns since the epoch\].
    pub fn since_ns(&self) -> Option<i64> {
        self.since_ns
    }

    /// Takes what the publisher's life `instance` tells of its alarm.
    pub fn take(&mut self, alarm: &AlarmMessage, instance: &str, now_ns: i64) {
        let is_latched = matches!(
            alarm.state,
            AlarmState::Collision | AlarmState::Acknowledged
        );
        // A publisher that is silent may be one that does not tell how old a latch is.
        let is_known = alarm.state != AlarmState::Silent;
        match alarm.latched_for_ms {
            None if !is_latched && is_known => *self = Self::default(),
            None if !is_latched => {}
            told_ms => {
                if self.instance != instance {
                    self.before_ns = self.since_ns;
                    instance.clone_into(&mut self.instance);
                }
                let age_ns = |ms: u64| {
                    i64::try_from(ms)
                        .unwrap_or(i64::MAX)
                        .saturating_mul(NS_PER_MS)
                };
                let told_ns = told_ms.map(|ms| now_ns.saturating_sub(age_ns(ms)));
                let own_ns = told_ns.or(self.since_ns).unwrap_or(now_ns);
                self.since_ns = Some(
                    self.before_ns
                        .map_or(own_ns, |before_ns| before_ns.min(own_ns)),
                );
            }
        }
    }
}
