//! What the cell is told: ROS 2 messages and JSON over Zenoh, Modbus registers for a PLC, and the life of the alarm
//! behind them. The outside of it is described in `docs/publish.md`.
//!
//! Not a safety function: it must not be what protects a person.

mod alarm;
mod config;
mod diagnostics;
mod error;
mod json;
pub mod message;
mod modbus;
mod outputs;
mod poses;
mod publisher;
mod ros2;
mod status;

pub use config::{Config, ConfigError, Latch, ModbusConfig, Ros2Config, ZenohConfig};
pub use error::PublishError;
pub use publisher::{Publisher, Setup, StreamInfo};
