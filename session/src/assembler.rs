//! Assembly of messages into states of all joints, in the robot's order. Pure: no clock, no I/O.
//!
//! A message may name joints in any order and only some of them; several publishers may share a topic. The assembler
//! uses the publishers that measure efforts, takes the time from the recording's [`Clock`], refuses values that are no
//! measurement, and counts what it refuses.

mod gather;
mod layout;
mod order;
mod report;

use tauscope_archive::{Twice, ros};

use crate::publisher::{Publisher, choose};
use crate::selection::Selection;
use crate::values::{Judgement, Ranges, Refused};

pub use gather::{Gather, Whole, stamp_of};
pub use layout::{Layout, Layouts};
use order::{Next, Order};

/// Reasons for undecodable messages that are listed.
/// Resolution: what a person reads.
const MOST_REASONS: usize = 4;
/// Jumps of the stamps that are listed.
/// Resolution: what a person reads.
const MOST_JUMPS: usize = 3;

/// Counts of an [`Assembler`]: numbers of messages or states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// States handed on.
    pub packed: u64,
    /// States and side messages refused because a number in them is not finite.
    pub not_finite: u64,
    /// Messages refused because a value in them is no measurement.
    pub impossible: u64,
    /// States refused because a newer one had come before.
    pub late: u64,
    /// States behind a jump of the stamps that were refused.
    pub behind: u64,
    /// States with the stamp and the values of the one before; nothing is lost by leaving them out.
    pub repeated: u64,
    /// Copies of states that came before others; nothing is lost by leaving them out.
    pub copies: u64,
    /// States with the stamp of the one before and other values.
    pub stalled: u64,
    /// States without a joint that never came, or came much later.
    pub parted: u64,
    /// Messages without what their topic is for: a state without positions, an effort that is absent.
    pub incomplete: u64,
    /// Messages that name a joint of the robot more than once.
    pub ambiguous: u64,
    /// Messages about other joints than the robot's.
    pub foreign: u64,
    /// Messages of publishers that are not used; nothing is lost by leaving them out.
    pub unused: u64,
    /// States whose efforts are no measurement because one of them dropped to zero; the states are handed on.
    pub unmeasured: u64,
    /// Jumps back of the stamps.
    pub resets: u64,
}

impl Counts {
    /// Messages and states that are lost.
    pub fn dropped(&self) -> u64 {
        self.not_finite
            + self.impossible
            + self.late
            + self.behind
            + self.stalled
            + self.parted
            + self.incomplete
            + self.ambiguous
    }
}

/// Result of taking a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Taken {
    /// The state is whole and follows the one before.
    Follows(Whole),
    /// The state is whole and the first behind a jump of the stamps.
    SetBack(Whole),
    /// There is no new state.
    Nothing,
}

/// Assembles states from messages.
#[derive(Debug)]
pub struct Assembler {
    selection: Selection,
    layouts: Layouts,
    gather: Gather,
    order: Order,
    /// By joint and field, values that are no measurement.
    impossible: Vec<[Refused; 3]>,
    /// By joint, efforts that dropped to zero.
    dropouts: Vec<Refused>,
    refuses_set_back: bool,
    keeps_velocity: bool,
    messages: u64,
    counts: Counts,
    twice: Option<(usize, [usize; 2])>,
    undecodable: Vec<(String, u64)>,
    /// Time of the first message, and when it was received \[ns\].
    first_ns: Option<(i64, i64)>,
    /// Stamp of the message before \[ns\].
    before_ns: Option<i64>,
    /// When the stamps jumped back, and by how much \[ns\].
    jumps: Vec<(i64, i64)>,
}

impl Assembler {
    /// Of a live source, of which nothing is known before its messages come.
    pub fn live(joint_names: &[String]) -> Self {
        Self::new(Selection::live(joint_names))
    }

    pub(crate) fn new(selection: Selection) -> Self {
        let count = selection.joint_names.len();
        Self {
            layouts: Layouts::new(&selection.joint_names),
            gather: Gather::new(count),
            order: Order::default(),
            impossible: vec![<_>::default(); count],
            dropouts: vec![Refused::default(); count],
            selection,
            refuses_set_back: false,
            keeps_velocity: false,
            messages: 0,
            counts: Counts::default(),
            twice: None,
            undecodable: Vec::new(),
            first_ns: None,
            before_ns: None,
            jumps: Vec::new(),
        }
    }

    /// Uses velocities also where they are not the derivative of the positions: for readers that judge them by themselves.
    #[must_use]
    pub fn keeping_velocity(mut self) -> Self {
        self.keeps_velocity = true;
        self
    }

    /// Refuses what follows a jump back of the stamps, until they have caught up: for readers that need time to advance.
    #[must_use]
    pub fn refusing_set_back(mut self) -> Self {
        self.refuses_set_back = true;
        self
    }

    /// Counts so far.
    pub fn counts(&self) -> Counts {
        Counts {
            parted: self.gather.in_vain(),
            ..self.counts
        }
    }

    /// Publishers on the topic so far.
    pub fn publishers(&self) -> Vec<Publisher> {
        let listed = self.selection.publishers.listed().into_iter();
        listed.map(|(_, publisher)| publisher).collect()
    }

    /// Which of the robot's joints a message names: bit j is joint j.
    pub fn joints_of(&mut self, message: &ros::JointState) -> u32 {
        self.layouts.of(&message.name).joints
    }

    /// Counts a message that cannot be decoded, with the reason.
    pub fn undecodable(&mut self, reason: &str) {
        // Reasons that differ in a number are one reason.
        let words = |text: &str| text.replace(|c: char| c.is_ascii_digit(), "");
        let is_same = |(known, _): &(String, u64)| known == reason || words(known) == words(reason);
        let known = self.undecodable.iter().position(is_same);
        let place = known.unwrap_or_else(|| {
            if self.undecodable.len() < MOST_REASONS {
                self.undecodable.push((reason.to_owned(), 0));
            }
            self.undecodable.len() - 1
        });
        self.undecodable[place].1 += 1;
    }

    /// Takes a message that was received at `received_ns`.
    pub fn take(&mut self, message: &ros::JointState, received_ns: i64) -> Taken {
        self.messages += 1;
        let time_ns = self
            .selection
            .clock
            .time_ns(message.header.stamp.ns(), received_ns);
        self.first_ns.get_or_insert((time_ns, received_ns));
        let is_used = self.is_used(message, received_ns);
        let layout = self.layouts.of(&message.name);
        if layout.joints == 0 {
            self.counts.foreign += 1;
            return Taken::Nothing;
        }
        if !is_used {
            self.counts.unused += 1;
            return Taken::Nothing;
        }
        if let Some(twice) = layout.twice {
            self.counts.ambiguous += 1;
            self.twice.get_or_insert(twice);
            return Taken::Nothing;
        }
        let judged = judge(
            &mut self.selection.ranges,
            (&mut self.impossible, &mut self.dropouts),
            (&layout.places, message, time_ns),
        );
        if judged == Judgement::Impossible {
            self.counts.impossible += 1;
            return Taken::Nothing;
        }
        let lacks_effort = judged == Judgement::Dropout;
        let times_ns = (time_ns, received_ns);
        let Some(mut whole) = self.gather.add(layout, message, times_ns, lacks_effort) else {
            return Taken::Nothing;
        };
        if self.selection.of_velocity.is_some() && !self.keeps_velocity {
            whole.has_velocity = false;
            whole.velocity = Default::default();
        }
        self.counts.unmeasured += u64::from(lacks_effort);
        if !whole.is_finite(self.selection.joint_names.len()) {
            self.counts.not_finite += 1;
            return Taken::Nothing;
        }
        if !whole.has_position {
            self.counts.incomplete += 1;
            return Taken::Nothing;
        }
        self.ordered(&whole, received_ns)
    }

    /// Whether the message's publisher is used.
    fn is_used(&mut self, message: &ros::JointState, received_ns: i64) -> bool {
        let known = self.selection.publishers.all.len();
        let Some(place) = self.selection.publishers.add(message, received_ns) else {
            return true;
        };
        // A first look knows all publishers of a recording but late ones. A live source begins with none.
        if self.selection.publishers.all.len() > known {
            self.selection.used =
                choose(&self.selection.publishers.all, &self.selection.joint_names);
        }
        if self.selection.publishers.all[place].messages == 1 {
            // The first look has counted it already; its times are those of this reading.
            self.selection.publishers.all[place].first_ns = received_ns;
        }
        self.selection.used[place]
    }

    fn ordered(&mut self, whole: &Whole, received_ns: i64) -> Taken {
        let before_ns = self.before_ns.replace(whole.stamp_ns);
        let jumped =
            before_ns.is_some_and(|before_ns| order::jumps_back(before_ns, whole.stamp_ns));
        if jumped {
            self.counts.resets += 1;
            if self.jumps.len() < MOST_JUMPS {
                let (_, first_ns) = self.first_ns.unwrap_or_default();
                let by_ns = before_ns.unwrap_or_default() - whole.stamp_ns;
                self.jumps.push((received_ns - first_ns, by_ns));
            }
        }
        match self.order.next(whole, self.refuses_set_back) {
            Next::Follows => return Taken::Follows(*whole),
            Next::SetBack => return Taken::SetBack(*whole),
            Next::Late => self.counts.late += 1,
            Next::Behind => self.counts.behind += 1,
            Next::Repeated => self.counts.repeated += 1,
            Next::Copy => self.counts.copies += 1,
            Next::Stalled => self.counts.stalled += 1,
        }
        Taken::Nothing
    }

    /// The joint that messages name more than once, if they do.
    pub fn twice(&self) -> Option<Twice> {
        self.twice.map(|(joint, places)| Twice {
            joint: self.selection.joint_names[joint].clone(),
            entries: places.map(|place| place + 1),
            messages: self.counts.ambiguous,
        })
    }

    /// The first joint, and its field, that came and was never finite.
    pub fn never_finite(&self) -> Option<(String, &'static str)> {
        let (joint, field) = self.gather.never_finite()?;
        Some((self.selection.joint_names[joint].clone(), field))
    }

    /// Number of values and messages refused so far.
    pub fn refused(&self) -> u64 {
        self.gather.bad() + self.counts.ambiguous + self.counts.impossible + self.counts.unmeasured
    }
}

/// Judges the finite values of a message; the worst judgement counts.
fn judge(
    ranges: &mut Ranges,
    (impossible, dropouts): (&mut [[Refused; 3]], &mut [Refused]),
    (places, message, time_ns): (&[Option<usize>], &ros::JointState, i64),
) -> Judgement {
    let fields = [&message.position, &message.velocity, &message.effort];
    let mut worst = Judgement::Possible;
    for (field, values) in fields.into_iter().enumerate() {
        for (&value, place) in values.iter().zip(places) {
            let Some(joint) = *place else { continue };
            if !value.is_finite() {
                continue;
            }
            let judgement = ranges.take(joint, field, value);
            let is_impossible = judgement == Judgement::Impossible;
            impossible[joint][field].add(time_ns, value, is_impossible);
            if field == 2 {
                let is_dropout = judgement == Judgement::Dropout;
                dropouts[joint].add(time_ns, value, is_dropout);
            }
            worst = worst.max(judgement);
        }
    }
    worst
}
