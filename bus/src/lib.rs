//! What a stage speaks: sample types, the stage traits, and links (in process, iceoryx2, Zenoh)
//! behind one interface.
//!
//! A *stream* is the ordered sequence of samples that one stage puts out, all of one type. A *link*
//! carries a stream from that stage to one that listens to it. A *stage* is a pure state machine: a
//! sample in, samples out, all time taken from the samples. So the same stage runs live, in replay
//! and in a test; what differs is the links around it.

mod effort_unit;
pub mod link;
pub mod sample;
pub mod seat;
pub mod shell;
pub mod stage;

pub use effort_unit::EffortUnit;
pub use link::{
    Audience, Domain, InProcess, Keep, LinkError, Position, Received, Receiver, ReceiverCounts,
    Sender, SenderCounts, SharedMemory, Transport, Zenoh, ZenohEndpoints, ZenohRouter,
};
pub use sample::{
    Detection, EventKind, Header, Health, JointArray, JointState, MAX_JOINTS, Name, Sample,
    SampleKind, SampleRef, TwinState, flags,
};
pub use seat::Seat;
pub use stage::{Emit, Progress, Sink, Source, Stage, StageError};
