//! Samples: the data types on the bus. Each has a fixed size and is `#[repr(C)]`, so that it can be written directly
//! into shared memory and read there.
//!
//! Joints are in the order of the robot's URDF, which every stage of a cell knows; entries from
//! [`Header::joint_count`] on are zero. Angles are rad (or m for a prismatic joint), velocities
//! rad/s, efforts N m (N) or A, as the cell declares.

mod check;
mod command;
mod name;

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

pub(crate) use check::MOST_SAMPLES;
pub use check::Unsound;
use check::Values as _;
pub use command::{Command, Verb};
pub use name::Name;

/// Largest number of joints of a cell. Fixed, because the size of a sample is.
/// Resolution: size of a sample; arms have 6 or 7 joints, two arms 14.
pub const MAX_JOINTS: usize = 16;

/// One number per joint, in URDF order.
pub type JointArray = [f64; MAX_JOINTS];

/// Bits of [`Header::flags`].
pub mod flags {
    /// End of the stream; the rest of the sample is void.
    pub const END: u32 = 1;
    /// Velocity measured by the source (otherwise differentiated).
    pub const VELOCITY_MEASURED: u32 = 1 << 1;
    /// Effort measured by the source (otherwise zero).
    pub const EFFORT_MEASURED: u32 = 1 << 2;
    /// Commanded motion in `command_*`.
    pub const COMMAND: u32 = 1 << 3;
    /// Effort of an external twin in `reference_effort`.
    pub const REFERENCE: u32 = 1 << 4;
    /// Attached tool in `tool_*`.
    pub const TOOL: u32 = 1 << 5;
    /// Filters have settled: the derived values are valid.
    pub const READY: u32 = 1 << 6;
    /// State reset at this sample, because the clock jumped or a gap was too long for the filters to bridge.
    pub const RESET: u32 = 1 << 7;
    /// Estimates in `force_n` and `link` of a detection.
    pub const FORCE: u32 = 1 << 8;
    /// Commanded velocity given by the source (otherwise differentiated from the position).
    pub const COMMAND_VELOCITY: u32 = 1 << 9;
    /// Alarm: a contact, or a change of the arm.
    pub const ALARM: u32 = 1 << 10;
    /// The detection is a change of the arm, not a contact; its size is in `size`.
    pub const CHANGE: u32 = 1 << 11;
    /// Request to the detectors to relearn the robot's baseline behaviour from this sample on.
    pub const LEARN: u32 = 1 << 12;
    /// Frequency content of the force in `content_n` of a detection.
    pub const CONTENT: u32 = 1 << 13;
    /// Unit vectors in `rise_direction` and `motion_direction` of a detection.
    pub const DIRECTIONS: u32 = 1 << 14;
}

/// Header of every sample.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Header {
    /// Time of the measurement: the header stamp of the message it came from \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Time of reception at the source \[ns since the epoch\]; the archive's log time.
    pub received_ns: i64,
    /// Sequence number in the stream, from 0; a gap means loss. Set by the sending link.
    pub sequence: u64,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Number of valid entries of a [`JointArray`].
    pub joint_count: u32,
}

impl Header {
    /// Whether all bits of `mask` are set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
    }
}

/// Measurements of a robot at one instant, with the commands and the tool at that instant.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/JointState/2")]
pub struct JointState {
    /// Stamp, sequence, flags.
    pub header: Header,
    /// Measured position \[rad\].
    pub position: JointArray,
    /// Measured velocity, or the differentiated position \[rad/s\].
    pub velocity: JointArray,
    /// Measured effort \[N m or A\].
    pub effort: JointArray,
    /// Newest commanded position at or before the stamp \[rad\]; see [`flags::COMMAND`].
    pub command_position: JointArray,
    /// Velocity of the commanded motion \[rad/s\].
    pub command_velocity: JointArray,
    /// Newest effort at or before the stamp from an external twin; see [`flags::REFERENCE`].
    pub reference_effort: JointArray,
    /// Mass of the attached tool \[kg\]; see [`flags::TOOL`].
    pub tool_mass_kg: f64,
    /// Centre of mass of the tool in the tool link's frame \[m\].
    pub tool_com_m: [f64; 3],
    /// Inertia of the tool about its centre of mass, tool axes: xx, xy, xz, yy, yz, zz \[kg m²\].
    pub tool_inertia_kgm2: [f64; 6],
    /// Command to the pipeline, in force from this sample on; all zeros for none.
    pub command: Command,
}

/// State of the twin for a [`JointState`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/TwinState/1")]
pub struct TwinState {
    /// Stamp, sequence, flags; [`flags::READY`] once the filters have settled.
    pub header: Header,
    /// Position of the twin's motion \[rad\].
    pub position: JointArray,
    /// Velocity of the twin's motion \[rad/s\].
    pub velocity: JointArray,
    /// Acceleration of the twin's motion \[rad/s²\].
    pub acceleration: JointArray,
    /// Measured effort as received.
    pub effort: JointArray,
    /// Effort that the same motion requires, in the measured effort's unit, corrected by the
    /// calibration; not filtered.
    pub expected_effort: JointArray,
    /// Measured effort through the effort low-pass.
    pub filtered_effort: JointArray,
    /// Expected effort through the same low-pass.
    pub filtered_expected_effort: JointArray,
    /// `filtered_effort - filtered_expected_effort`.
    pub residual: JointArray,
}

/// Change of a detector's alarm at one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// No change.
    None,
    /// The alarm was raised at this sample.
    Onset,
    /// The alarm ended at this sample.
    Offset,
}

/// Result of a detector for one sample. It emits one for every sample that it accepts.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/Detection/4")]
pub struct Detection {
    /// Stamp, sequence, flags; [`flags::READY`] if the detector judged this sample.
    pub header: Header,
    /// The detector's canonical name, e.g. `twin_regression`.
    pub detector: Name,
    /// State of the detector: `not_ready`, `free`, `contact`, `collision`, `cooperation`, …;
    /// for a change of the arm ([`flags::CHANGE`]) the effect's canonical name, or `unknown`.
    pub state: Name,
    /// The touched or changed link, estimated from the whole contact so far; empty where not estimated.
    pub link: Name,
    /// A second link that fits nearly as well; empty where the first is unambiguous, or none is estimated.
    pub other_link: Name,
    /// Score, in the unit of the detector.
    pub score: f64,
    /// Alarm threshold of the score.
    pub threshold: f64,
    /// Estimated start of the contact or change \[ns since the epoch\], while an alarm lasts
    /// ([`flags::ALARM`]).
    pub contact_ns: i64,
    /// Estimated force on the robot, world frame \[N\]; see [`flags::FORCE`].
    pub force_n: [f64; 3],
    /// Assumed point of application of the force, world frame \[m\].
    pub point_m: [f64; 3],
    /// Joints that carry torque from the whole contact so far: bit j for joint j in URDF order.
    pub joints: u32,
    /// 0 no change, 1 onset, 2 offset of the alarm at this sample; read it with [`Detection::event`].
    pub event: u32,
    /// Size of a change ([`flags::CHANGE`]): \[kg\] for `payload`, a factor for `torque_gain`, otherwise in the
    /// unit of the effect's parameter \[effort unit, or that per rad/s\]; 0 for `unknown`.
    pub size: f64,
    /// Magnitude of the external force within the detector's frequency band, by axis of the world frame \[N\];
    /// see [`flags::CONTENT`].
    pub content_n: [f64; 3],
    /// Unit vector of the external force's change at the detection of the contact, world frame; zeros for a force
    /// that did not change. See [`flags::DIRECTIONS`].
    pub rise_direction: [f64; 3],
    /// Unit vector of the tool's velocity at the start of the contact, world frame; zeros for a tool at rest.
    /// See [`flags::DIRECTIONS`].
    pub motion_direction: [f64; 3],
}

impl Detection {
    /// Value of `event` at the sample that raises the alarm.
    pub const ONSET: u32 = 1;
    /// Value of `event` at the sample that ends it.
    pub const OFFSET: u32 = 2;

    /// Change of the alarm at this sample.
    pub fn event(&self) -> EventKind {
        match self.event {
            Self::ONSET => EventKind::Onset,
            Self::OFFSET => EventKind::Offset,
            _ => EventKind::None,
        }
    }

    /// Whether the alarm is raised.
    pub fn alarm(&self) -> bool {
        self.header.has(flags::ALARM)
    }
}

/// Health report of a stage, sent once per second of stream time and at the end.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/Health/1")]
pub struct Health {
    /// Stamp of the stage's newest sample; sequence of this report.
    pub header: Header,
    /// Name of the stage.
    pub stage: Name,
    /// Samples received.
    pub received: u64,
    /// Samples emitted.
    pub emitted: u64,
    /// Samples lost before or in the stage: gaps in the inputs, and refused samples.
    pub dropped: u64,
    /// Number of restarts by the supervisor.
    pub restarts: u64,
}

/// Sample type of a stream; in JSON `joint_state`, `twin_state` and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SampleKind {
    /// [`JointState`].
    JointState,
    /// [`TwinState`].
    TwinState,
    /// [`Detection`].
    Detection,
    /// [`Health`].
    Health,
}

impl SampleKind {
    /// Name of the type on the bus, equal in every process and language.
    pub fn type_name(self) -> &'static str {
        match self {
            Self::JointState => "tauscope/JointState/2",
            Self::TwinState => "tauscope/TwinState/1",
            Self::Detection => "tauscope/Detection/4",
            Self::Health => "tauscope/Health/1",
        }
    }

    /// Whether a stream of this kind may carry alarms.
    pub fn may_alarm(self) -> bool {
        self == Self::Detection
    }
}

/// A type that links can carry.
///
/// It is plain old data: every bit pattern is a value, but not every value is valid. The receiving end of a link
/// validates each sample with [`Sample::check`] before a stage gets it.
pub trait Sample: Pod + Default + std::fmt::Debug + Send + Sync + ZeroCopySend + 'static {
    /// Kind of this type.
    const KIND: SampleKind;
    /// The header.
    fn header(&self) -> &Header;
    /// The header, mutable.
    fn header_mut(&mut self) -> &mut Header;
    /// The sample as a value whose type is known at run time only.
    fn as_ref(&self) -> SampleRef<'_>;
    /// The sample of this type; `None` for one of another type.
    fn of(sample: SampleRef<'_>) -> Option<&Self>;
    /// Checks that no value can make a stage panic or corrupt its state. In an end mark only the header is checked.
    ///
    /// # Errors
    /// The first invalid value.
    fn check(&self) -> Result<(), Unsound>;
    /// See [`SampleRef::is_urgent`].
    fn is_urgent(&self) -> bool {
        self.as_ref().is_urgent()
    }
}

/// A sample whose type is known at run time only.
#[derive(Debug, Clone, Copy)]
pub enum SampleRef<'a> {
    /// From a source.
    JointState(&'a JointState),
    /// From a twin.
    TwinState(&'a TwinState),
    /// From a detector.
    Detection(&'a Detection),
    /// From the shell around any stage.
    Health(&'a Health),
}

impl SampleRef<'_> {
    /// The header.
    pub fn header(&self) -> &Header {
        match self {
            Self::JointState(sample) => &sample.header,
            Self::TwinState(sample) => &sample.header,
            Self::Detection(sample) => &sample.header,
            Self::Health(sample) => &sample.header,
        }
    }

    /// Whether the sample is delivered at once, without batching delay: an alarm or a command.
    pub fn is_urgent(&self) -> bool {
        match self {
            Self::JointState(state) => state.command.verb != 0,
            Self::Detection(detection) => detection.event != 0 || detection.alarm(),
            Self::TwinState(_) | Self::Health(_) => false,
        }
    }

    /// Kind of the sample.
    pub fn kind(&self) -> SampleKind {
        match self {
            Self::JointState(_) => SampleKind::JointState,
            Self::TwinState(_) => SampleKind::TwinState,
            Self::Detection(_) => SampleKind::Detection,
            Self::Health(_) => SampleKind::Health,
        }
    }
}

macro_rules! samples {
    ($($name:ident),+) => {$(
        impl Sample for $name {
            const KIND: SampleKind = SampleKind::$name;
            fn header(&self) -> &Header {
                &self.header
            }
            fn header_mut(&mut self) -> &mut Header {
                &mut self.header
            }
            fn as_ref(&self) -> SampleRef<'_> {
                SampleRef::$name(self)
            }
            fn of(sample: SampleRef<'_>) -> Option<&Self> {
                match sample {
                    SampleRef::$name(sample) => Some(sample),
                    _ => None,
                }
            }
            fn check(&self) -> Result<(), Unsound> {
                self.header.check()?;
                if self.header.has(flags::END) {
                    return Ok(());
                }
                self.check_values()
            }
        }
    )+};
}
samples!(JointState, TwinState, Detection, Health);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_names_the_type_on_the_bus() {
        for kind in [
            (JointState::KIND.type_name(), type_name::<JointState>()),
            (TwinState::KIND.type_name(), type_name::<TwinState>()),
            (Detection::KIND.type_name(), type_name::<Detection>()),
            (Health::KIND.type_name(), type_name::<Health>()),
        ] {
            assert_eq!(kind.0, kind.1);
        }
    }

    fn type_name<T: ZeroCopySend>() -> &'static str {
        // SAFETY: reads a constant of the type.
        #[allow(unsafe_code)]
        unsafe {
            <T as ZeroCopySend>::type_name()
        }
    }
}
