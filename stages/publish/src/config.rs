//! The stage's part of the pipeline file.

use std::net::SocketAddr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outputs to the cell. At least one of `zenoh` and `modbus` must be given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Messages over Zenoh: JSON, and optionally ROS 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zenoh: Option<ZenohConfig>,
    /// A Modbus TCP server for a PLC.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modbus: Option<ModbusConfig>,
    /// Contacts that stay latched until they are acknowledged.
    pub latch: Latch,
    /// Silence of any one detector after which all outputs read as stop \[s\].
    #[schemars(range(min = 0.02, max = 60.0))]
    pub stop_after_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            zenoh: None,
            modbus: None,
            latch: Latch::default(),
            stop_after_s: 0.5,
        }
    }
}

/// Contacts that stay latched until they are acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Latch {
    /// Contacts that the detector classifies as collisions.
    #[default]
    Collision,
    /// All contacts: for a detector that does not distinguish collisions from intended contacts.
    Contact,
}

/// Messages over Zenoh. At least one of `connect` and `listen` must be given: multicast discovery is off.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZenohConfig {
    /// Endpoints to connect to, e.g. `tcp/localhost:7447`; retried until they answer.
    pub connect: Vec<String>,
    /// Endpoints to listen on.
    pub listen: Vec<String>,
    /// Whether JSON is published under `<cell>/<topic>`.
    pub json: bool,
    /// Whether the cell reports to `tauscope fleet`: a liveliness token, the status once a second, each contact.
    pub fleet: bool,
    /// ROS 2 messages as `rmw_zenoh` expects them; by default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ros2: Option<Ros2Config>,
}

impl Default for ZenohConfig {
    fn default() -> Self {
        Self {
            connect: Vec::new(),
            listen: Vec::new(),
            json: true,
            fleet: true,
            ros2: None,
        }
    }
}

/// ROS 2 messages.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ros2Config {
    /// `ROS_DOMAIN_ID` of the subscribers.
    #[schemars(range(max = 232))]
    pub domain: u32,
    /// Namespace of the topics; by default the cell's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub namespace: Option<String>,
}

/// A Modbus TCP server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ModbusConfig {
    /// Address and port to listen on. Any client that reaches it can read and acknowledge: Modbus has no passwords.
    #[schemars(with = "String")]
    pub listen: SocketAddr,
    /// Time without a request after which a client is disconnected \[s\]. Otherwise a client with an unplugged cable
    /// would occupy its slot for ever.
    #[schemars(range(min = 0.1, max = 86_400.0))]
    pub idle_s: f64,
}

impl Default for ModbusConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 1502)),
            // Resolution: a PLC polls several times a second; a person who tries it out waits at most this long for a
            // slot.
            idle_s: 60.0,
        }
    }
}

/// Errors in the configuration of a publisher.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// A publisher without an output.
    #[error("the publisher has no output; give `zenoh` or `modbus`")]
    Nobody,
    /// A Zenoh output without endpoints.
    #[error("`zenoh` needs at least one endpoint in `connect` or `listen`")]
    NoEndpoint,
    /// A Zenoh output without messages.
    #[error("`zenoh` publishes nothing; give `json: true`, `fleet: true` or `ros2: {{}}`")]
    NoMessages,
    /// A publisher without a detector.
    #[error("a publisher listens to at least one detector")]
    NoDetector,
    /// A publisher for several cells.
    #[error("a publisher serves one cell; make a publisher for each")]
    ManyCells,
}

impl Config {
    /// Checks that the publisher can run.
    ///
    /// # Errors
    /// The first fault found.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.zenoh.is_none() && self.modbus.is_none() {
            return Err(ConfigError::Nobody);
        }
        let Some(zenoh) = &self.zenoh else {
            return Ok(());
        };
        if zenoh.connect.is_empty() && zenoh.listen.is_empty() {
            return Err(ConfigError::NoEndpoint);
        }
        if !zenoh.json && !zenoh.fleet && zenoh.ros2.is_none() {
            return Err(ConfigError::NoMessages);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(yaml: &str) -> Config {
        serde_saphyr::from_str(yaml).unwrap()
    }

    #[test]
    fn what_stands_in_the_file() {
        let config = parse("{zenoh: {connect: [tcp/a:1], ros2: {}}, modbus: {}, latch: contact}");
        assert_eq!(config.check(), Ok(()));
        assert_eq!(config.latch, Latch::Contact);
        assert!(config.modbus.unwrap().listen.ip().is_loopback());
    }

    #[test]
    fn a_publisher_that_nobody_hears_is_refused() {
        for (yaml, error) in [
            ("{}", ConfigError::Nobody),
            ("{zenoh: {ros2: {}}}", ConfigError::NoEndpoint),
            (
                "{zenoh: {listen: [tcp/a:1], json: false, fleet: false}}",
                ConfigError::NoMessages,
            ),
        ] {
            assert_eq!(parse(yaml).check(), Err(error), "{yaml}");
        }
    }
}
