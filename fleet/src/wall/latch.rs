//! Start time of a cell's latch.

use tauscope_publish::message::{AlarmMessage, AlarmState};

const NS_PER_MS: i64 = 1_000_000;

/// A latched alarm, until its release is reported: a stale cell is still latched.
#[derive(Debug, Default)]
pub struct Latch {
    /// Start of the latch \[ns since the epoch\].
    since_ns: Option<i64>,
    /// The publisher instance that reported it.
    instance: String,
    /// Start of the latch in an earlier publisher instance, which the new one does not know \[ns since the epoch\].
    before_ns: Option<i64>,
}

impl Latch {
    /// Restores the latch from an earlier run of the fleet host: the publisher instance that was latched, and the
    /// start of the latch \[ns since the epoch\].
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

    /// Returns the start of the latch \[ns since the epoch\].
    pub fn since_ns(&self) -> Option<i64> {
        self.since_ns
    }

    /// Processes the alarm that the publisher instance `instance` reports.
    pub fn take(&mut self, alarm: &AlarmMessage, instance: &str, now_ns: i64) {
        let is_latched = matches!(
            alarm.state,
            AlarmState::Collision | AlarmState::Acknowledged
        );
        // A silent publisher may be of a version that does not report the age of a latch.
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
