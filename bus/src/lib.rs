#![doc = include_str!("../README.md")]

pub mod clock;
pub mod command;
mod contact;
mod effort_unit;
pub mod link;
pub mod sample;
pub mod seat;
pub mod shell;
pub mod stage;
mod trouble;

pub use contact::{Contact, ContactFollower, Force};
pub use effort_unit::EffortUnit;
pub use link::{
    Audience, Domain, InProcess, Keep, LinkError, Position, Received, Receiver, ReceiverCounts,
    Sender, SenderCounts, SharedMemory, Transport, Wake, Zenoh, ZenohEndpoints, ZenohRouter,
    zenoh_reason,
};
pub use sample::{
    Command, Detection, EventKind, Header, Health, JointArray, JointState, MAX_JOINTS, Name,
    Sample, SampleKind, SampleRef, TwinState, Unsound, Verb, flags,
};
pub use seat::Seat;
pub use stage::{Emit, Progress, Sink, Source, Stage, StageError};
pub use trouble::Trouble;
