//! Outputs to the cell: ROS 2 messages and JSON over Zenoh, Modbus registers for a PLC, and the states of the alarm
//! behind them. The interface is described in `docs/publish.md`.
//!
//! Not a safety function: it must not be used to protect a person.

mod alarm;
mod config;
mod diagnostics;
mod error;
mod fleet;
mod json;
pub mod message;
mod modbus;
mod outputs;
mod poses;
mod presence;
mod publisher;
mod report;
mod ros2;
mod session;
mod setup;
mod status;

pub use config::{Config, ConfigError, Latch, ModbusConfig, Ros2Config, ZenohConfig};
pub use error::PublishError;
pub use fleet::Facts;
pub use presence::alive_key;
pub use publisher::Publisher;
pub use setup::{Setup, StreamInfo};
