//! Faults of the connection to a controller, with their remedies. Pure.

use tauscope_bus::Trouble;

use super::field::{Field, Part, fields};
use crate::config::UrRtdeConfig;
use crate::tcp::Unreachable;

/// Faults that end or prevent a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    /// No connection.
    Unreachable(Unreachable),
    /// No answer to this request.
    Unanswered(&'static str),
    /// Bytes that are not packages of RTDE.
    Nonsense(Vec<u8>),
    /// No support of protocol version 2.
    Version,
    /// Outputs that the controller does not have.
    NotFound(Vec<Field>),
    /// An invalid answer to the request for outputs.
    Recipe(String),
    /// A refused start.
    NotStarted,
    /// No data after an accepted start.
    Silent,
    /// Data that do not match the recipe.
    Data(String),
    /// A connection closed by the controller or the network.
    Closed(String),
}

impl Fault {
    /// Describes the fault with its remedy; `was_well` if there were samples before.
    pub fn trouble(&self, settings: &UrRtdeConfig, was_well: bool) -> Trouble {
        let address = settings.address();
        let lost = if was_well {
            "the connection is lost: "
        } else {
            ""
        };
        let of = |what: String| Trouble::new(format!("{lost}the controller {address} {what}"));
        let trouble = match self {
            Self::Unreachable(why) => of(format!("cannot be reached: {why}")),
            Self::Unanswered(request) => of(format!(
                "accepts the connection and does not answer {request}"
            )),
            Self::Nonsense(_) => of("answers, but not as RTDE".to_owned()),
            Self::Version => of("does not speak version 2 of RTDE".to_owned()),
            Self::NotFound(missing) => of(format!("has no output {}", names(missing))),
            Self::Recipe(why) => of(format!(
                "answers the request for outputs with nonsense: {why}"
            )),
            Self::NotStarted => of("refuses to begin".to_owned()),
            Self::Silent => of("has agreed to begin and sends nothing".to_owned()),
            Self::Data(why) => of(format!("sends other data than it agreed to: {why}")),
            Self::Closed(why) => of(format!("closed the connection: {why}")),
        };
        let trouble = match self {
            Self::Nonsense(bytes) => trouble.sees([format!("bytes \"{}\"", bytes.escape_ascii())]),
            _ => trouble,
        };
        trouble
            .expects([format!(
                "RTDE on {address} with {}",
                names(&fields(settings, true))
            )])
            .likely(Some(self.remedy()))
    }

    fn remedy(&self) -> String {
        let words = match self {
            Self::Unreachable(Unreachable::Refused) => {
                "`port` is wrong, or RTDE is switched off: PolyScope, Settings, Security, Services"
            }
            Self::Unreachable(Unreachable::Name(_) | Unreachable::NoAddress) => {
                "`host` is misspelt: PolyScope shows the address under Settings, System, Network"
            }
            Self::Unreachable(_) => {
                "the controller is off, `host` has the wrong address, or a firewall is between"
            }
            Self::Unanswered(_) | Self::Nonsense(_) => {
                "another service has this port: RTDE is on 30004"
            }
            Self::Version => {
                "the controller's software is too old: update PolyScope to 3.5 or newer"
            }
            Self::NotFound(missing) => return without(missing),
            Self::Recipe(_) | Self::Data(_) => {
                "another program speaks on this port, or a proxy between changes the bytes"
            }
            Self::NotStarted => "too many programs read from this controller: end one of them",
            Self::Silent => "the controller is starting or has stopped: look at its screen",
            Self::Closed(_) => {
                "the controller was switched off or started again, or the network is interrupted"
            }
        };
        words.to_owned()
    }
}

fn names(fields: &[Field]) -> String {
    let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
    names.join(", ")
}

/// Returns the remedy for missing outputs.
fn without(missing: &[Field]) -> String {
    let of = |part: Part| match part {
        Part::Effort => Some("set `effort: actual_current` and `effort_unit: A`"),
        Part::TargetMoment => Some("set `target_moment: false`"),
        Part::Mass | Part::CentreOfMass | Part::Inertia => {
            Some("set `payload: false` and give the tool in the cell")
        }
        Part::Timestamp | Part::Position | Part::Velocity => None,
    };
    let mut all: Vec<&str> = missing.iter().filter_map(|field| of(field.part)).collect();
    all.dedup();
    all.push("update PolyScope: outputs were added over the years");
    all.join(", or ")
}
