#![doc = include_str!("../README.md")]

mod effort_unit;
pub mod link;
pub mod sample;
pub mod seat;
pub mod shell;
pub mod stage;
mod trouble;

pub use effort_unit::EffortUnit;
pub use link::{
    Audience, Domain, InProcess, Keep, LinkError, Position, Received, Receiver, ReceiverCounts,
    Sender, SenderCounts, SharedMemory, Transport, Zenoh, ZenohEndpoints, ZenohRouter,
    zenoh_reason,
};
pub use sample::{
    Detection, EventKind, Header, Health, JointArray, JointState, MAX_JOINTS, Name, Sample,
    SampleKind, SampleRef, TwinState, flags,
};
pub use seat::Seat;
pub use stage::{Emit, Progress, Sink, Source, Stage, StageError};
pub use trouble::Trouble;
