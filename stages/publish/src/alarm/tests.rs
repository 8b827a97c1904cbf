//! Behaviour of the alarm in short sequences of samples, a tenth of a second apart.

use tauscope_bus::command::Request;
use tauscope_bus::{Detection, flags};

use super::*;

const TENTH_NS: i64 = 100_000_000;

struct Story {
    alarm: Alarm,
    tenths: i64,
}

impl Story {
    fn new(latch: Latch) -> Self {
        Self {
            alarm: Alarm::new(latch, 1, false),
            tenths: 0,
        }
    }

    /// Feeds the next sample, for which the detector reports `state`.
    fn says(&mut self, state: &str) -> (State, bool) {
        self.tenths += 1;
        let detection = said(self.tenths, state);
        self.alarm.detection(0, &detection);
        (self.alarm.state(), self.alarm.is_free())
    }

    /// Feeds a command that takes effect at the next sample.
    fn told(&mut self, request: &Request) -> &mut Self {
        let stamp_ns = (self.tenths + 1) * TENTH_NS;
        self.alarm.command(stamp_ns, request.command().unwrap());
        self
    }
}

fn said(tenths: i64, state: &str) -> Detection {
    let mut detection = Detection {
        state: state.into(),
        ..Detection::default()
    };
    detection.header.stamp_ns = tenths * TENTH_NS;
    detection.header.flags = match state {
        "not_ready" => 0,
        "free" => flags::READY,
        _ => flags::READY | flags::ALARM,
    };
    detection
}

#[test]
fn nothing_is_free_before_the_detector_judges() {
    let mut story = Story::new(Latch::Collision);
    assert_eq!(
        (story.alarm.state(), story.alarm.is_free()),
        (State::NotReady, false)
    );
    assert_eq!(story.says("not_ready"), (State::NotReady, false));
    assert_eq!(story.says("free"), (State::Free, true));
    assert_eq!(story.says("not_ready"), (State::NotReady, false));
}

#[test]
fn nothing_is_free_before_every_detector_judges() {
    let mut alarm = Alarm::new(Latch::Collision, 2, false);
    alarm.detection(0, &said(1, "free"));
    assert!(!alarm.is_free());
    alarm.detection(1, &said(1, "free"));
    assert!(alarm.is_free());
    alarm.detection(1, &said(2, "contact"));
    alarm.detection(0, &said(2, "free"));
    assert_eq!(alarm.state(), State::Contact, "one detector is enough");
}

#[test]
fn a_contact_ends_by_itself() {
    let mut story = Story::new(Latch::Collision);
    assert_eq!(story.says("contact"), (State::Contact, false));
    assert_eq!(story.says("cooperation"), (State::Contact, false));
    assert_eq!(story.says("free"), (State::Free, true));
}

#[test]
fn a_collision_stays_until_it_is_acknowledged() {
    let mut story = Story::new(Latch::Collision);
    assert_eq!(story.says("collision"), (State::Collision, false));
    for _ in 0..1000 {
        assert_eq!(story.says("free"), (State::Collision, false));
    }
    assert_eq!(
        story.told(&Request::Acknowledge).says("free"),
        (State::Free, true)
    );
}

#[test]
fn an_acknowledged_collision_is_free_when_it_ends() {
    let mut story = Story::new(Latch::Collision);
    story.says("collision");
    story.told(&Request::Acknowledge);
    assert_eq!(story.says("collision"), (State::Acknowledged, false));
    assert_eq!(story.says("contact"), (State::Acknowledged, false));
    assert_eq!(story.says("free"), (State::Free, true));
}

#[test]
fn a_new_collision_needs_a_new_acknowledgement() {
    let mut story = Story::new(Latch::Collision);
    story.says("collision");
    story.told(&Request::Acknowledge).says("collision");
    story.says("contact");
    assert_eq!(story.says("collision"), (State::Collision, false));
}

#[test]
fn where_all_contacts_latch_a_contact_stays() {
    let mut story = Story::new(Latch::Contact);
    story.says("contact");
    assert_eq!(story.says("free"), (State::Collision, false));
    assert_eq!(
        story.told(&Request::Acknowledge).says("free"),
        (State::Free, true)
    );
}

#[test]
fn an_acknowledgement_of_nothing_does_nothing() {
    let mut story = Story::new(Latch::Collision);
    story.told(&Request::Acknowledge).says("free");
    assert_eq!(story.says("collision"), (State::Collision, false));
}

#[test]
fn a_mute_is_a_lease_that_ends_by_itself() {
    let mut story = Story::new(Latch::Collision);
    story.told(&Request::Mute { seconds: 0.3 });
    assert_eq!(story.says("contact"), (State::Contact, true));
    assert_eq!(
        story.says("collision"),
        (State::Contact, true),
        "nothing is latched"
    );
    assert!((story.alarm.muted_s() - 0.2).abs() < 1e-9);
    assert_eq!(story.says("free"), (State::Free, true));
    assert_eq!(
        story.says("contact"),
        (State::Contact, false),
        "the lease is over"
    );
}

#[test]
fn a_collision_that_outlasts_the_mute_is_latched() {
    let mut story = Story::new(Latch::Collision);
    story
        .told(&Request::Mute { seconds: 0.2 })
        .says("collision");
    assert_eq!(story.says("collision"), (State::Contact, true));
    assert_eq!(story.says("collision"), (State::Collision, false));
}

#[test]
fn a_mute_releases_no_latched_collision_and_a_mute_of_zero_ends_one() {
    let mut story = Story::new(Latch::Collision);
    story.says("collision");
    story.told(&Request::Mute { seconds: 60.0 });
    assert_eq!(story.says("free"), (State::Collision, false));
    story.told(&Request::Acknowledge).says("free");
    assert_eq!(story.says("contact"), (State::Contact, true));
    story.told(&Request::Mute { seconds: 0.0 });
    assert_eq!(story.says("contact"), (State::Contact, false));
}

#[test]
fn a_clock_that_is_set_back_ends_a_mute() {
    let mut story = Story::new(Latch::Collision);
    story.told(&Request::Mute { seconds: 60.0 }).says("free");
    let mut back = said(-5, "contact");
    back.header.flags |= flags::RESET;
    story.alarm.detection(0, &back);
    assert!(!story.alarm.is_free());
}

#[test]
fn a_command_holds_from_its_stamp_whichever_stream_is_faster() {
    let mut story = Story::new(Latch::Collision);
    let ahead = Request::Acknowledge.command().unwrap();
    story.alarm.command(3 * TENTH_NS, ahead);
    assert_eq!(story.says("collision").0, State::Collision);
    assert_eq!(story.says("free").0, State::Collision, "not yet");
    assert_eq!(story.says("free").0, State::Free);
}

#[test]
fn after_a_restart_somebody_must_look() {
    let mut alarm = Alarm::new(Latch::Collision, 1, true);
    alarm.detection(0, &said(1, "free"));
    assert_eq!((alarm.state(), alarm.is_free()), (State::Collision, false));
    alarm.command(2 * TENTH_NS, Request::Acknowledge.command().unwrap());
    alarm.detection(0, &said(2, "free"));
    assert!(alarm.is_free());
}

#[test]
fn a_change_of_the_arm_is_no_contact() {
    let mut alarm = Alarm::new(Latch::Contact, 1, false);
    let mut change = said(1, "payload");
    change.header.flags |= flags::CHANGE;
    alarm.detection(0, &change);
    assert!(alarm.is_free());
}
