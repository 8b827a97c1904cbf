//! The unit of a cell's efforts.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Unit of an effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, JsonSchema)]
pub enum EffortUnit {
    /// Torque \[N m\] (force \[N\] for a prismatic joint).
    #[default]
    Nm,
    /// Motor current \[A\].
    A,
}

impl EffortUnit {
    /// All units.
    pub const ALL: [Self; 2] = [Self::Nm, Self::A];

    /// Name of the unit in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Nm => "Nm",
            Self::A => "A",
        }
    }
}

impl fmt::Display for EffortUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for EffortUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut all = Self::ALL.into_iter();
        let named = all.find(|unit| unit.as_str() == text);
        named.ok_or_else(|| format!("an effort is in Nm or in A, not in {text}"))
    }
}
