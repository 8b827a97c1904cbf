//! One program of the tests through the public face: linking one is what takes long.

mod archived_twin;
mod commands;
mod common;
mod conformance;
mod demo;
mod recorded;
#[path = "../../../tests/common/ur_controller.rs"]
mod ur_controller;
mod ur_rtde;
mod zenoh;
