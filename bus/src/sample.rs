//! Samples: what travels on the bus. Each is fixed in size and `#[repr(C)]`, so that it can be
//! written straight into shared memory and read there.
//!
//! Joints stand in the order of the robot's URDF, which every stage of a cell knows; entries from
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

/// The most joints one cell may have. Fixed, because a sample's size is.
/// Resolution: size of a sample; arms have 6 or 7 joints, two arms 14.
pub const MAX_JOINTS: usize = 16;

/// One number per joint, in URDF order.
pub type JointArray = [f64; MAX_JOINTS];

/// Bits of [`Header::flags`].
pub mod flags {
    /// The stream ends here; the rest of the sample is void.
    pub const END: u32 = 1;
    /// The source gave a velocity (else it was differentiated).
    pub const VELOCITY_MEASURED: u32 = 1 << 1;
    /// The source gave an effort (else it is zero).
    pub const EFFORT_MEASURED: u32 = 1 << 2;
    /// `command_*` hold a commanded motion.
    pub const COMMAND: u32 = 1 << 3;
    /// `reference_effort` holds somebody else's twin.
    pub const REFERENCE: u32 = 1 << 4;
    /// `tool_*` hold a tool that is attached now.
    pub const TOOL: u32 = 1 << 5;
    /// Filters have settled: the derived numbers can be trusted.
    pub const READY: u32 = 1 << 6;
    /// The clock jumped or a gap in the data was longer than filters bridge; state was reset here.
    pub const RESET: u32 = 1 << 7;
    /// `force_n` and `link` of a detection hold an estimate.
    pub const FORCE: u32 = 1 << 8;
    /// The commanded velocity is given (else it was differentiated from the position).
    pub const COMMAND_VELOCITY: u32 = 1 << 9;
    /// A detector sees a contact, or a change of the arm, now.
    pub const ALARM: u32 = 1 << 10;
    /// What a detection tells of is no contact but a change of the arm, of the size in `size`.
    pub const CHANGE: u32 = 1 << 11;
    /// Somebody asks the detectors to learn the robot's usual behaviour anew, from this sample on.
    pub const LEARN: u32 = 1 << 12;
    /// `content_n` of a detection holds the force's frequency content.
    pub const CONTENT: u32 = 1 << 13;
    /// `rise_direction` and `motion_direction` of a detection hold unit vectors.
    pub const DIRECTIONS: u32 = 1 << 14;
}

/// What every sample begins with.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable, ZeroCopySend)]
pub struct Header {
    /// Time of the measurement: the header stamp of the message it came from \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Time of reception at the source \[ns since the epoch\]; the archive's log time.
    pub received_ns: i64,
    /// Number of the sample in its stream, from 0; a hole means loss. Set by the sending link.
    pub sequence: u64,
    /// Bits of [`flags`].
    pub flags: u32,
    /// How many entries of a [`JointArray`] are meant.
    pub joint_count: u32,
}

impl Header {
    /// Whether all bits of `mask` are set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
    }
}

/// What a robot says of itself at one instant, and what belongs to that instant.
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
    /// Its velocity \[rad/s\].
    pub command_velocity: JointArray,
    /// Newest effort at or before the stamp that another twin computed; see [`flags::REFERENCE`].
    pub reference_effort: JointArray,
    /// Mass of the attached tool \[kg\]; see [`flags::TOOL`].
    pub tool_mass_kg: f64,
    /// Its centre of mass in the tool link's frame \[m\].
    pub tool_com_m: [f64; 3],
    /// Its inertia about that centre, tool axes: xx, xy, xz, yy, yz, zz \[kg m²\].
    pub tool_inertia_kgm2: [f64; 6],
    /// What somebody told the pipeline, from this sample on; all zeros for nothing.
    pub command: Command,
}

/// What the twin made of a [`JointState`].
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

/// What a detector said of one sample, beyond its score.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// Nothing began or ended here.
    None,
    /// The alarm was raised at this sample.
    Onset,
    /// The alarm ended at this sample.
    Offset,
}

/// A detector's verdict on one sample. One goes out for every sample that came in.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/Detection/4")]
pub struct Detection {
    /// Stamp, sequence, flags; [`flags::READY`] if the detector judged this sample.
    pub header: Header,
    /// The detector's canonical name, e.g. `twin_regression`.
    pub detector: Name,
    /// What it says now in its own words: `not_ready`, `free`, `contact`, `collision`, `cooperation`, …;
    /// of a change of the arm ([`flags::CHANGE`]) the effect's canonical name, or `unknown`.
    pub state: Name,
    /// The touched or changed link, estimated from the whole contact so far; empty where not estimated.
    pub link: Name,
    /// A second link that fits nearly as well; empty where the first is certain, or none is estimated.
    pub other_link: Name,
    /// The score; its unit is the detector's.
    pub score: f64,
    /// The score from which on it raises an alarm.
    pub threshold: f64,
    /// Estimated beginning of the contact or change \[ns since the epoch\], while an alarm lasts
    /// ([`flags::ALARM`]).
    pub contact_ns: i64,
    /// Estimated force on the robot, world frame \[N\]; see [`flags::FORCE`].
    pub force_n: [f64; 3],
    /// Where the force is taken to act, world frame \[m\].
    pub point_m: [f64; 3],
    /// The joints that carry torque from the whole contact so far: bit j for joint j in URDF order.
    pub joints: u32,
    /// 0 nothing, 1 the alarm begins, 2 it ends at this sample; read it with [`Detection::event`].
    pub event: u32,
    /// Size of a change ([`flags::CHANGE`]): \[kg\] for `payload`, a factor for `torque_gain`, else in the
    /// unit of the effect's parameter \[effort unit, or that per rad/s\]; 0 for `unknown`.
    pub size: f64,
    /// By direction of the world frame, how much of the external force lies in the band that the detector
    /// watches \[N\]; see [`flags::CONTENT`].
    pub content_n: [f64; 3],
    /// Unit vector of the external force's change as the contact was detected, world frame; zeros for a force
    /// that did not change. See [`flags::DIRECTIONS`].
    pub rise_direction: [f64; 3],
    /// Unit vector of the tool's velocity as the contact began, world frame; zeros for a tool that stood
    /// still. See [`flags::DIRECTIONS`].
    pub motion_direction: [f64; 3],
}

impl Detection {
    /// Value of `event` at the sample that raises the alarm.
    pub const ONSET: u32 = 1;
    /// Value of `event` at the sample that ends it.
    pub const OFFSET: u32 = 2;

    /// What begins or ends here.
    pub fn event(&self) -> EventKind {
        match self.event {
            Self::ONSET => EventKind::Onset,
            Self::OFFSET => EventKind::Offset,
            _ => EventKind::None,
        }
    }

    /// Whether the detector sees a contact now.
    pub fn alarm(&self) -> bool {
        self.header.has(flags::ALARM)
    }
}

/// How a stage fares; one a second of stream time and one at the end.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("tauscope/Health/1")]
pub struct Health {
    /// Stamp of the stage's newest sample; sequence of this report.
    pub header: Header,
    /// The stage.
    pub stage: Name,
    /// Samples that came in.
    pub received: u64,
    /// Samples that went out.
    pub emitted: u64,
    /// Samples lost before or in the stage: holes in the inputs and samples it had to refuse.
    pub dropped: u64,
    /// How often the supervisor started it again.
    pub restarts: u64,
}

/// Which of the sample types a stream carries; in JSON `joint_state`, `twin_state` and so on.
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
    /// The type's name on the bus, the same in every process and language.
    pub fn type_name(self) -> &'static str {
        match self {
            Self::JointState => "tauscope/JointState/2",
            Self::TwinState => "tauscope/TwinState/1",
            Self::Detection => "tauscope/Detection/4",
            Self::Health => "tauscope/Health/1",
        }
    }

    /// Whether a stream of this kind may hold an alarm.
    pub fn may_alarm(self) -> bool {
        self == Self::Detection
    }
}

/// A type that can travel on a link.
///
/// It is plain old data: every bit pattern is a value. Whether it makes sense is another question, which the receiving
/// end of a link asks with [`Sample::check`] before a stage sees it.
pub trait Sample: Pod + Default + std::fmt::Debug + Send + Sync + ZeroCopySend + 'static {
    /// Which type this is.
    const KIND: SampleKind;
    /// What every sample begins with.
    fn header(&self) -> &Header;
    /// The same, to be written.
    fn header_mut(&mut self) -> &mut Header;
    /// This sample where the type was only known at run time.
    fn as_ref(&self) -> SampleRef<'_>;
    /// Whether a stage may see it: nothing in it may make one panic or spoil its state. Of an end mark only the header
    /// counts.
    ///
    /// # Errors
    /// What is wrong with it.
    fn check(&self) -> Result<(), Unsound>;
    /// As [`SampleRef::is_urgent`].
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
    /// What the sample begins with.
    pub fn header(&self) -> &Header {
        match self {
            Self::JointState(sample) => &sample.header,
            Self::TwinState(sample) => &sample.header,
            Self::Detection(sample) => &sample.header,
            Self::Health(sample) => &sample.header,
        }
    }

    /// Whether those who hear it are to have it at once, though more would be cheaper together: an alarm, or what
    /// somebody told the pipeline.
    pub fn is_urgent(&self) -> bool {
        match self {
            Self::JointState(state) => state.command.verb != 0,
            Self::Detection(detection) => detection.event != 0 || detection.alarm(),
            Self::TwinState(_) | Self::Health(_) => false,
        }
    }

    /// Which type it is.
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
