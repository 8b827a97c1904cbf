//! Commands to the pipeline, as part of a joint state.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::Name;

macro_rules! verbs {
    ($($(#[$doc:meta])* $verb:ident = $number:literal, $name:ident;)+) => {
        /// Verb of a [`Command`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u32)]
        pub enum Verb {
            $($(#[$doc])* $verb = $number,)+
        }

        impl Verb {
            /// All verbs.
            pub const ALL: &[Self] = &[$(Self::$verb),+];

            /// Name of the verb, as in a [`Request`](crate::command::Request).
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$verb => stringify!($name),)+
                }
            }
        }
    };
}
verbs! {
    /// Acknowledges the alarm.
    Acknowledge = 1, acknowledge;
    /// Mutes alarms for a limited time, during which they raise no stop.
    Mute = 2, mute;
    /// Sets the attached tool.
    Payload = 3, payload;
    /// Restarts the learning of detectors.
    Learn = 4, learn;
    /// Writes a note to the archive.
    Label = 5, label;
}

/// A command, in the joint state from which on it is in force. All zeros for none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Command {
    /// A [`Verb`] as its number; 0 for no command. Read it with [`Command::verb`].
    pub verb: u32,
    /// Zero.
    pub reserved: u32,
    /// Duration of a mute \[s\], or mass of a payload \[kg\].
    pub value: f64,
    /// Centre of mass of a payload in the tool link's frame \[m\].
    pub com_m: [f64; 3],
    /// Text of a label; for other commands the requester, empty where unknown.
    pub text: Name,
}

impl Command {
    /// The verb; `None` for no command, or a verb of a later version.
    pub fn verb(&self) -> Option<Verb> {
        let mut all = Verb::ALL.iter().copied();
        all.find(|verb| *verb as u32 == self.verb)
    }

    /// The requester, where known; `None` for a label, whose text is the note.
    pub fn by(&self) -> Option<&str> {
        let by = self.text.as_str();
        (self.verb()? != Verb::Label && !by.is_empty()).then_some(by)
    }

    /// Description for people; `None` for no command.
    pub fn in_words(&self) -> Option<String> {
        let what = self.what_in_words()?;
        Some(match self.by() {
            Some(by) => format!("{what}, by {by}"),
            None => what,
        })
    }

    fn what_in_words(&self) -> Option<String> {
        Some(match self.verb()? {
            Verb::Acknowledge => "alarm acknowledged".to_owned(),
            Verb::Mute if self.value > 0.0 => format!("alarms muted for {} s", self.value),
            Verb::Mute => "mute taken back".to_owned(),
            Verb::Payload if self.value > 0.0 => {
                let [x, y, z] = self.com_m;
                format!("payload {} kg, centre of mass {x} {y} {z} m", self.value)
            }
            Verb::Payload => "no payload".to_owned(),
            Verb::Learn => "detectors learn anew".to_owned(),
            Verb::Label => format!("label: {}", self.text),
        })
    }

    /// A command without arguments.
    pub(crate) fn of(verb: Verb) -> Self {
        Self {
            verb: verb as u32,
            ..Self::default()
        }
    }

    /// Arguments of the verb by name, as archived. Numbers are restored exactly.
    pub fn arguments(&self) -> Vec<(&'static str, String)> {
        let mut arguments = self.own_arguments();
        arguments.extend(self.by().map(|by| ("by", by.to_owned())));
        arguments
    }

    fn own_arguments(&self) -> Vec<(&'static str, String)> {
        match self.verb() {
            Some(Verb::Mute) => vec![("seconds", self.value.to_string())],
            Some(Verb::Payload) => {
                let [x, y, z] = self.com_m;
                vec![
                    ("mass_kg", self.value.to_string()),
                    ("com_m", format!("{x} {y} {z}")),
                ]
            }
            Some(Verb::Label) => vec![("text", self.text.to_string())],
            Some(Verb::Acknowledge | Verb::Learn) | None => Vec::new(),
        }
    }
}
