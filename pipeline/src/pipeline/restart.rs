//! When a stage that died is started again, as the pipeline file says.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When a stage is started again, and when that is given up, which ends the run.
///
/// Stages of one thread begin and die together: of what they say, the strictest holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Restart {
    /// After which ends.
    pub when: When,
    /// How often within `within_s`; once more gives it up.
    pub most: u32,
    /// Over which time starts are counted \[s\].
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub within_s: f64,
    /// The second start within `within_s` comes so long after the death, each one more after twice the time before
    /// \[s\]. The first one comes at once.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub wait_s: f64,
    /// But no start comes later than this \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub longest_wait_s: f64,
}

/// After which ends a stage is started again.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// After none: its death ends the run.
    Never,
    /// If it failed or was killed.
    #[default]
    OnFailure,
    /// Also if it ended by itself, for an `outside` program that ends where it should not.
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
    /// The strictest of both.
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

/// What a file may have: the word alone, or all of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RestartEntry {
    /// After which ends; the rest as it is by default.
    Word(When),
    /// All of it.
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
