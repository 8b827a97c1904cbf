//! Commands of people and controllers to a running pipeline.
//!
//! A client sends a command as a [`Request`] (JSON). The source of the cell validates it, attaches it to the next
//! joint state as a [`Command`] and answers with the stamp of that joint state, from which on the command is in
//! force. Commands are therefore ordered with all other samples and archived with their sample. In a replay they take
//! effect at the same sample.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sample::{Command, Name, Verb};

mod ask;
mod mute;

pub use ask::{AskError, ask, ask_signed};
pub use mute::MuteLease;

/// Longest lease of a mute \[s\].
pub const LONGEST_MUTE_S: f64 = 60.0;
/// Upper bound on the mass of an accepted payload \[kg\].
const HEAVIEST_KG: f64 = 10_000.0;
/// Upper bound on each coordinate of an accepted centre of mass \[m\].
const FARTHEST_M: f64 = 100.0;

/// The key expression on which the source of `cell` accepts requests.
pub fn key(cell: &str) -> String {
    format!("{cell}/commands")
}

/// A command as a client sends it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "verb", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Acknowledges the alarm: a latched collision is released once it has ended.
    Acknowledge,
    /// Mutes alarms: they raise no stop until the lease expires; 0 s ends it at once.
    Mute {
        /// Duration, starting at the sample that carries the command \[s\].
        #[schemars(range(min = 0.0, max = LONGEST_MUTE_S))]
        seconds: f64,
    },
    /// Sets the tool that is attached from now on, as a point mass; 0 kg for none.
    Payload {
        /// Mass \[kg\].
        mass_kg: f64,
        /// Centre of mass in the tool link's frame \[m\].
        #[serde(default)]
        com_m: [f64; 3],
    },
    /// Restarts the learning of detectors that learn while they run.
    Learn,
    /// Writes a note to the archive.
    Label {
        /// Text of the note, at most 48 bytes of UTF-8.
        text: String,
    },
}

/// A [`Request`] with its requester: in JSON, the request with one more member, `by`.
#[derive(Debug, Clone, PartialEq)]
pub struct Signed {
    /// The request.
    pub request: Request,
    /// Name of the requester, if given: at most 48 bytes. It is not authenticated.
    pub by: Option<String>,
}

impl Signed {
    /// Parses a request with or without a requester.
    ///
    /// # Errors
    /// If `json` is not a valid request.
    pub fn from_json(json: &[u8]) -> Result<Self, Refusal> {
        let none = |error: serde_json::Error| Refusal::NotARequest(error.to_string());
        let mut value: serde_json::Value = serde_json::from_slice(json).map_err(none)?;
        let by = value
            .as_object_mut()
            .and_then(|members| members.remove("by"));
        let by = by.filter(|by| !by.is_null());
        Ok(Self {
            by: by
                .map(serde_json::from_value)
                .transpose()
                .map_err(|error| Refusal::NotARequest(format!("`by`: {error}")))?,
            request: serde_json::from_value(value).map_err(none)?,
        })
    }

    /// Serialises to JSON.
    ///
    /// # Errors
    /// If the serialisation fails.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut value = serde_json::to_value(&self.request)?;
        if let (Some(members), Some(by)) = (value.as_object_mut(), &self.by) {
            members.insert("by".to_owned(), by.as_str().into());
        }
        serde_json::to_string(&value)
    }

    /// Returns the requested command. Its text is the requester, or for a label the note.
    ///
    /// # Errors
    /// If an argument or the name of the requester is invalid.
    pub fn command(&self) -> Result<Command, Refusal> {
        let mut command = self.request.command()?;
        let by = self.by.as_deref();
        if let Some(by) = by.filter(|_| command.verb() != Some(Verb::Label)) {
            if !is_label(by) {
                return Err(Refusal::Name { found: by.len() });
            }
            command.text = Name::new(by);
        }
        Ok(command)
    }
}

/// The answer of a source to a [`Request`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "answer", rename_all = "snake_case")]
pub enum Answer {
    /// Command accepted.
    Taken {
        /// Stamp of the first sample for which the command is in force \[ns since the epoch\].
        stamp_ns: i64,
    },
    /// Command rejected; nothing has changed.
    Refused {
        /// Reason, and what to do.
        reason: String,
    },
}

/// Reason for the rejection of a request.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Malformed request.
    #[error("this is no command: {0}")]
    NotARequest(String),
    /// Mute duration out of range \[s\].
    #[error("a mute lasts 0 to {LONGEST_MUTE_S} s, not {0} s; ask again when it has ended")]
    Lease(f64),
    /// Payload mass out of range \[kg\].
    #[error("a payload has a mass of 0 to {HEAVIEST_KG} kg, not {0} kg")]
    Mass(f64),
    /// Centre of mass too far from the tool link.
    #[error("a centre of mass is within {FARTHEST_M} m of the tool link")]
    CentreOfMass,
    /// Label that is empty, too long or has control characters.
    #[error("a label has 1 to {limit} bytes of text, no line breaks, not these {found}", limit = Name::CAPACITY)]
    Label {
        /// Length \[bytes\].
        found: usize,
    },
    /// Name of the requester that is empty, too long or has control characters.
    #[error("the name of a requester has 1 to {limit} bytes, no line breaks, not these {found}", limit = Name::CAPACITY)]
    Name {
        /// Length \[bytes\].
        found: usize,
    },
}

impl Request {
    /// Parses an archived command from its verb and its arguments, as written by [`Command::arguments`].
    ///
    /// # Errors
    /// If the verb is unknown, or an argument is missing or invalid.
    pub fn archived<'a>(
        verb: &str,
        argument: impl Fn(&str) -> Option<&'a str>,
    ) -> Result<Command, Refusal> {
        let wrong = |name: &str| Refusal::NotARequest(format!("`{verb}` has no valid `{name}`"));
        let number = |name: &str| {
            let value = argument(name).and_then(|text| text.parse().ok());
            value.ok_or_else(|| wrong(name))
        };
        let known = Verb::ALL.iter().find(|each| each.as_str() == verb);
        let request = match known.ok_or_else(|| Refusal::NotARequest(format!("`{verb}`")))? {
            Verb::Acknowledge => Request::Acknowledge,
            Verb::Mute => Request::Mute {
                seconds: number("seconds")?,
            },
            Verb::Payload => {
                let text = argument("com_m").ok_or_else(|| wrong("com_m"))?;
                let com_m: Result<Vec<f64>, _> = text.split(' ').map(str::parse).collect();
                let com_m = com_m.ok().and_then(|com_m| com_m.try_into().ok());
                Request::Payload {
                    mass_kg: number("mass_kg")?,
                    com_m: com_m.ok_or_else(|| wrong("com_m"))?,
                }
            }
            Verb::Learn => Request::Learn,
            Verb::Label => Request::Label {
                text: argument("text").ok_or_else(|| wrong("text"))?.to_owned(),
            },
        };
        let by = argument("by").map(str::to_owned);
        Signed { request, by }.command()
    }

    /// Parses a request.
    ///
    /// # Errors
    /// If `json` is not a valid request.
    pub fn from_json(json: &[u8]) -> Result<Self, Refusal> {
        serde_json::from_slice(json).map_err(|error| Refusal::NotARequest(error.to_string()))
    }

    /// Validates the request and returns its command.
    ///
    /// # Errors
    /// If an argument is invalid.
    pub fn command(&self) -> Result<Command, Refusal> {
        Ok(match self {
            Self::Acknowledge => Command::of(Verb::Acknowledge),
            Self::Mute { seconds } if !(0.0..=LONGEST_MUTE_S).contains(seconds) => {
                return Err(Refusal::Lease(*seconds));
            }
            Self::Mute { seconds } => Command {
                value: *seconds,
                ..Command::of(Verb::Mute)
            },
            Self::Payload { mass_kg, .. } if !(0.0..=HEAVIEST_KG).contains(mass_kg) => {
                return Err(Refusal::Mass(*mass_kg));
            }
            Self::Payload { com_m, .. }
                if com_m.iter().any(|x| x.abs() > FARTHEST_M || x.is_nan()) =>
            {
                return Err(Refusal::CentreOfMass);
            }
            Self::Payload { mass_kg, com_m } => Command {
                value: *mass_kg,
                com_m: *com_m,
                ..Command::of(Verb::Payload)
            },
            Self::Learn => Command::of(Verb::Learn),
            Self::Label { text } if !is_label(text) => {
                return Err(Refusal::Label { found: text.len() });
            }
            Self::Label { text } => Command {
                text: Name::new(text),
                ..Command::of(Verb::Label)
            },
        })
    }
}

fn is_label(text: &str) -> bool {
    (1..=Name::CAPACITY).contains(&text.len()) && !text.chars().any(char::is_control)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(json: &str) -> Result<Command, String> {
        Request::from_json(json.as_bytes())
            .and_then(|request| request.command())
            .map_err(|refusal| refusal.to_string())
    }

    #[test]
    fn what_is_asked_for_is_what_is_told() {
        let command = taken(r#"{"verb": "acknowledge"}"#).unwrap();
        assert_eq!(command.verb(), Some(Verb::Acknowledge));
        let command = taken(r#"{"verb": "mute", "seconds": 60}"#).unwrap();
        assert_eq!((command.verb(), command.value), (Some(Verb::Mute), 60.0));
        let command = taken(r#"{"verb": "payload", "mass_kg": 1.5}"#).unwrap();
        assert_eq!((command.value, command.com_m), (1.5, [0.0; 3]));
        let command = taken(r#"{"verb": "label", "text": "new gripper"}"#).unwrap();
        assert_eq!(command.text.as_str(), "new gripper");
        assert_eq!(Command::default().verb(), None);
    }

    #[test]
    fn what_cannot_be_is_refused_with_the_reason() {
        for (json, reason) in [
            (
                r#"{"verb": "stop"}"#,
                "unknown variant `stop`, expected one of `acknowledge`",
            ),
            (r#"{"verb": "mute"}"#, "missing field `seconds`"),
            (
                r#"{"verb": "mute", "seconds": 61}"#,
                "a mute lasts 0 to 60 s, not 61 s",
            ),
            (
                r#"{"verb": "mute", "seconds": -1}"#,
                "a mute lasts 0 to 60 s, not -1 s",
            ),
            (r#"{"verb": "payload", "mass_kg": -2}"#, "not -2 kg"),
            (
                r#"{"verb": "payload", "mass_kg": 2, "com_m": [0, 0, 1e9]}"#,
                "within 100 m",
            ),
            (
                r#"{"verb": "label", "text": ""}"#,
                "1 to 48 bytes of text, no line breaks, not these 0",
            ),
            ("free", "this is no command"),
        ] {
            let refusal = taken(json).unwrap_err();
            assert!(refusal.contains(reason), "{json}: {refusal}");
        }
    }

    #[test]
    fn who_asks_is_told_with_the_command_and_archived() {
        let json = br#"{"verb": "mute", "seconds": 2.5, "by": "anna"}"#;
        let signed = Signed::from_json(json).unwrap();
        let command = signed.command().unwrap();
        assert_eq!(command.by(), Some("anna"));
        assert_eq!(
            Signed::from_json(signed.to_json().unwrap().as_bytes()),
            Ok(signed)
        );
        let arguments = command.arguments();
        let find = |name: &str| {
            let found = arguments.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| value.as_str())
        };
        assert_eq!(Request::archived("mute", find), Ok(command));
        for (json, reason) in [
            (r#"{"verb": "learn", "by": ""}"#, "the name of a requester"),
            (r#"{"verb": "learn", "by": 3}"#, "`by`"),
        ] {
            let refusal = Signed::from_json(json.as_bytes()).and_then(|signed| signed.command());
            let refusal = refusal.map_err(|refusal| refusal.to_string());
            assert!(
                refusal.clone().is_err_and(|text| text.contains(reason)),
                "{json}: {refusal:?}"
            );
        }
    }

    #[test]
    fn an_archived_command_is_the_same() {
        for request in [
            Request::Acknowledge,
            Request::Mute { seconds: 0.1 + 0.2 },
            Request::Payload {
                mass_kg: 1.0 / 3.0,
                com_m: [1e-17, -0.1, 2.5],
            },
            Request::Learn,
            Request::Label {
                text: "ä b".to_owned(),
            },
        ] {
            let command = request.command().unwrap();
            let arguments = command.arguments();
            let find = |name: &str| {
                let found = arguments.iter().find(|(key, _)| *key == name);
                found.map(|(_, value)| value.as_str())
            };
            let verb = command.verb().unwrap();
            assert_eq!(Request::archived(verb.as_str(), find), Ok(command));
        }
    }
}
