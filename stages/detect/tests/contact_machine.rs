//! Algorithm 1 of Salt Ducaju et al. on synthetic norms.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use tauscope_detect::ContactKind;
use tauscope_detect::salt_ducaju::contact_machine::{Machine, MachineSettings, NewContact, Rule};
use tauscope_detect::salt_ducaju::contact_signals::Instant;

const MS: i64 = 1_000_000;

/// A rule with prepared answers, which records the contacts that it classifies.
struct Says {
    answers: Vec<ContactKind>,
    asked: Vec<NewContact>,
}

impl Says {
    fn all(answers: &[ContactKind]) -> Self {
        Self {
            answers: answers.to_vec(),
            asked: Vec::new(),
        }
    }
}

impl Rule for Says {
    fn classify(&mut self, contact: &NewContact) -> ContactKind {
        self.asked.push(*contact);
        self.answers[self.asked.len() - 1]
    }
}

fn machine() -> Machine {
    let settings = MachineSettings {
        force_threshold_n: 1.0,
        release_s: 0.01,
    };
    Machine::new(&settings, 100)
}

/// Returns the instant at `ms`, with these norms and this force along z.
fn instant(ms: i64, norms_n: [f64; 3], force_z: f64) -> Instant {
    Instant {
        stamp_ns: ms * MS,
        force_n: [0.0, 0.0, force_z],
        norms_n,
        velocity_m_per_s: [0.0, 0.0, 1e-3 * ms as f64],
        point_m: [0.0; 3],
    }
}

/// Returns the kinds after each millisecond of these norms.
fn kinds(
    machine: &mut Machine,
    says: &mut Says,
    norms: &[([f64; 3], i64)],
) -> Vec<Option<ContactKind>> {
    let mut ms = 0;
    let mut all = Vec::new();
    for &(norms, for_ms) in norms {
        for _ in 0..for_ms {
            let ongoing = machine.step(&instant(ms, norms, 0.0), says);
            all.push(ongoing.map(|(kind, _)| kind));
            ms += 1;
        }
    }
    all
}

const QUIET: [f64; 3] = [0.2; 3];
const X: [f64; 3] = [2.0, 0.2, 0.2];
const XY: [f64; 3] = [2.0, 2.0, 0.2];
const COLLISION: ContactKind = ContactKind::Collision;
const COOPERATION: ContactKind = ContactKind::Cooperation;

#[test]
fn a_contact_ends_where_all_norms_have_stayed_below_the_threshold() {
    for kind in [COLLISION, COOPERATION] {
        let says = &mut Says::all(&[kind]);
        let kinds = kinds(&mut machine(), says, &[(QUIET, 20), (X, 10), (QUIET, 20)]);
        assert_eq!(kinds[19], None);
        assert_eq!(kinds[20], Some(kind));
        // The newest norm above the threshold was at 29 ms; the contact is held for 10 ms.
        assert_eq!(kinds[39], Some(kind));
        assert_eq!(kinds[40], None);
        assert_eq!(says.asked.len(), 1);
    }
}

#[test]
fn a_cooperation_on_top_of_a_collision_is_seen_in_another_direction() {
    let says = &mut Says::all(&[COLLISION, COOPERATION]);
    let kinds = kinds(
        &mut machine(),
        says,
        &[(QUIET, 20), (X, 10), (XY, 10), (QUIET, 20)],
    );
    assert_eq!(kinds[29], Some(COLLISION));
    assert_eq!(kinds[30], Some(COOPERATION));
    assert!(says.asked[1].along[0].is_none() && says.asked[1].along[1].is_some());
    assert_eq!(kinds[59], None);
}

#[test]
fn a_direction_that_has_stopped_colliding_may_tell_of_the_next_contact() {
    let says = &mut Says::all(&[COLLISION, COLLISION, COOPERATION]);
    let phases = [(QUIET, 20), (X, 5), (XY, 5), ([0.2, 2.0, 0.2], 5), (XY, 5)];
    let kinds = kinds(&mut machine(), says, &phases);
    assert_eq!(kinds[34], Some(COLLISION));
    assert_eq!(kinds[35], Some(COOPERATION));
}

#[test]
fn a_cooperation_asks_no_more_until_it_has_ended() {
    let says = &mut Says::all(&[COOPERATION, COLLISION]);
    let phases = [(QUIET, 20), (X, 5), (XY, 5), (QUIET, 12), (X, 1)];
    let kinds = kinds(&mut machine(), says, &phases);
    assert_eq!(kinds[29], Some(COOPERATION));
    assert_eq!(*kinds.last().unwrap(), Some(COLLISION));
}

#[test]
fn the_search_goes_back_to_where_the_force_began_to_rise() {
    let (mut machine, mut says) = (machine(), Says::all(&[COLLISION]));
    // Drifts down until 40 ms, then rises by 0.5 N per millisecond with a short dip.
    for ms in 0..60 {
        let rise = 0.5 * (ms - 40).max(0) as f64 - if ms == 50 { 0.9 } else { 0.0 };
        let force = 5.0 - 0.01 * ms.min(40) as f64 + rise;
        let norms = if ms == 59 { [0.2, 0.2, 3.0] } else { QUIET };
        machine.step(&instant(ms, norms, force), &mut says);
    }
    let contact = says.asked[0];
    // 15 % of the rise, less than 3 ms after the trough.
    assert_eq!(contact.contact_ns, 42 * MS);
    assert!((contact.rise_n[2] - 8.5).abs() < 1e-9);
    let (rise, velocity) = contact.along[2].unwrap();
    assert!((rise - 9.5).abs() < 1e-9 && (velocity - 0.042).abs() < 1e-9);
}

#[test]
fn a_falling_force_is_a_rise_in_the_other_sense() {
    let (mut machine, mut says) = (machine(), Says::all(&[COLLISION]));
    for ms in 0..60 {
        let force = 2.0 - 0.5 * (ms - 40).max(0) as f64;
        let norms = if ms == 59 { [0.2, 0.2, 3.0] } else { QUIET };
        machine.step(&instant(ms, norms, force), &mut says);
    }
    assert!((says.asked[0].along[2].unwrap().0 + 9.5).abs() < 1e-9);
}
