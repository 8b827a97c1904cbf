//! Restart policy of a stage.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Restart policy of a stage. Exceeding the number of restarts ends the run.
///
/// Stages of one thread start and end together; the strictest of their policies applies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Restart {
    /// Ends after which the stage is restarted.
    pub when: When,
    /// Largest number of restarts within `within_s`; one more ends the run.
    pub most: u32,
    /// Time window in which restarts are counted \[s\].
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub within_s: f64,
    /// Delay before the second restart within `within_s` \[s\], doubled for each further one. The first restart is
    /// immediate.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub wait_s: f64,
    /// Upper bound of the delay \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub longest_wait_s: f64,
}

/// Ends after which a stage is restarted.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// None: its end ends the run.
    Never,
    /// It failed or was killed.
    #[default]
    OnFailure,
    /// It failed, was killed, or ended by itself, for an `outside` program that ends unexpectedly.
    Always,
}

impl Default for Restart {
    fn default() -> Self {
        Self {
            when: When::default(),
            most: 4,
            within_s: 10.0,
            wait_s: 0.05,
            longest_wait_s: 10.0,
        }
    }
}

impl Restart {
    /// Combines two policies into the strictest one.
    #[must_use]
    pub fn strictest(self, other: Self) -> Self {
        Self {
            when: self.when.min(other.when),
            most: self.most.min(other.most),
            within_s: self.within_s.max(other.within_s),
            wait_s: self.wait_s.max(other.wait_s),
            longest_wait_s: self.longest_wait_s.max(other.longest_wait_s),
        }
    }
}

/// Notations of a restart policy in the file: the keyword alone, or the full policy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RestartEntry {
    /// Ends after which the stage is restarted; defaults for the rest.
    Word(When),
    /// The full policy.
    All(Restart),
}

impl From<RestartEntry> for Restart {
    fn from(entry: RestartEntry) -> Self {
        match entry {
            RestartEntry::Word(when) => Self {
                when,
                ..Self::default()
            },
            RestartEntry::All(restart) => restart,
        }
    }
}
