//! The watch in many simulated cells, through the program: `simulate`, `calibrate` and `replay`. Arms of six and
//! seven joints with friction that warms up, coloured noise, motions of all kinds, and pushes by people. Then a
//! joint's friction or gain steps, or the arm picks up or puts down a payload.
//!
//! The whole suite, in release and over chosen seeds, with a table at the end:
//!
//! ```sh
//! WATCH_SEEDS=1..100 cargo test --release --test program watch_suite::changes \
//!     -- --ignored --nocapture
//! WATCH_SEEDS=1..9 WATCH_HOURS=1 cargo test --release --test program watch_suite::clean \
//!     -- --ignored --nocapture
//! ```

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod cell;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use crate::common::{tauscope, write};
use cell::{Cell, Change, MOVES_RAD_S, done, rows};
use rand::Rng;
use serde_json::{Value, json};

/// Motion after a change within which it must be named \[s\].
const WITHIN_S: f64 = 10.0;
/// Strength of a change of one joint, in units of the coloured noise, above which it must be reported.
const CLEAR: f64 = 4.0;

impl Cell {
    /// Reports of the watch on a recording, with the URDF or a twin calibrated on a free recording.
    fn watch(&self, folder: &Path, recording: &Path, free: Option<&Path>) -> Vec<Said> {
        let mut twin = json!({});
        if let Some(free) = free {
            let file = folder.join("twin.yaml");
            let mut calibrate = tauscope();
            calibrate
                .arg("calibrate")
                .arg("--robot")
                .arg(&self.urdf)
                .arg(free)
                .arg("--out")
                .arg(&file);
            done(calibrate);
            twin = json!({"model": file});
        }
        let pipeline = json!({
            "version": 1, "cells": {"cell": {"robot": self.urdf}},
            "stages": [
                {"name": "ingest", "ingest": {"file": {"path": recording}, "rate": "fast"}},
                {"name": "twin", "input": "ingest", "twin": twin},
                {"name": "watch", "input": "twin", "watch": {}},
            ],
        });
        let pipeline = write(&folder.join("pipeline.yaml"), &pipeline.to_string());
        let mut replay = tauscope();
        replay
            .arg("replay")
            .arg("--json")
            .arg("--pipeline")
            .arg(pipeline)
            .arg(recording);
        let summary: Value = serde_json::from_str(&done(replay)).unwrap();
        let events = summary[0]["detectors"][0]["events"].as_array().unwrap();
        events.iter().map(Said::of).collect()
    }
}

/// A report of the watch.
#[derive(Debug)]
struct Said {
    kind: String,
    joints: Vec<String>,
    link: String,
    t_s: f64,
    since_s: f64,
    size: f64,
}

impl Said {
    fn of(event: &Value) -> Self {
        let number = |key: &str| event[key].as_f64().unwrap_or(f64::NAN);
        let joints = event["joints"].as_array().unwrap();
        Self {
            kind: event["kind"].as_str().unwrap().to_owned(),
            joints: joints
                .iter()
                .map(|joint| joint.as_str().unwrap().to_owned())
                .collect(),
            link: event["link"].as_str().unwrap_or_default().to_owned(),
            t_s: number("t"),
            since_s: number("t_contact"),
            size: number("size"),
        }
    }

    fn is_change(&self) -> bool {
        self.kind != "contact"
    }

    /// Whether it names this change at its place.
    fn names(&self, change: Change, cell: &Cell) -> bool {
        match change {
            Change::Friction(j, _) => {
                self.kind == "coulomb_friction" && self.joints == [cell.joint(j)]
            }
            Change::Gain(j, _) => self.kind == "torque_gain" && self.joints == [cell.joint(j)],
            Change::Payload(_) => self.kind == "payload" && self.link == "tool",
            Change::Nothing => false,
        }
    }

    fn text(&self) -> String {
        let Self {
            kind,
            joints,
            link,
            t_s,
            since_s,
            size,
        } = self;
        format!(
            "{t_s:.1}: {kind} {size:+.2} {link} {} since {since_s:.1}",
            joints.join(" ")
        )
    }
}

/// Time that the arm moves between two times of a recording \[s\].
fn motion_s(recording: &Path, rate_hz: f64, from_s: f64, to_s: f64) -> f64 {
    let mut moving = 0.0;
    rows(recording, |since_s, message| {
        let moves = message.velocity.iter().any(|v| v.abs() > MOVES_RAD_S);
        moving += f64::from(u8::from(moves && from_s <= since_s && since_s <= to_s));
    });
    moving / rate_hz
}

/// Result of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Told {
    Right,
    Late,
    Wrong,
    Missed,
}

/// Result of a cell: that of its change, the motion before the report \[s\], the number of false reports, and a
/// description.
struct Outcome {
    told: Told,
    motion_s: f64,
    /// See [`Cell::strength`].
    strength: f64,
    false_words: usize,
    text: String,
}

fn run(seed: u64) -> (Change, Outcome) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut cell = Cell::new(seed);
    let mut physics = cell.physics();
    let motion = cell.motion();
    let calibrated = cell.rng.random_bool(0.5);
    let free = calibrated.then(|| {
        let recording = json!({"name": "free", "duration_s": 25, "motion": cell.motion()});
        cell.simulate(folder, &physics, &recording, Change::Nothing, 0.0)
    });
    // Some cells have been observed for long at this point, others hardly.
    let at_s = if seed.is_multiple_of(2) {
        cell.within(48.0..55.0)
    } else {
        cell.within(90.0..100.0)
    };
    let ends_s = at_s + 20.0;
    let change = cell.change(at_s, ends_s, &mut physics);
    let mut contacts = Vec::new();
    if cell.rng.random_bool(0.5) {
        contacts.push(cell.push(30.0));
    }
    let recording =
        json!({"name": "watched", "duration_s": ends_s, "motion": motion, "contacts": contacts});
    let recording = cell.simulate(folder, &physics, &recording, change, at_s);
    let said = cell.watch(folder, &recording, free.as_deref());
    let (before, after): (Vec<&Said>, Vec<&Said>) = said.iter().partition(|said| said.t_s < at_s);
    let early = before.iter().filter(|said| said.is_change()).count();
    let first = after.iter().find(|said| said.is_change());
    let motion_s = first.map_or(f64::NAN, |said| {
        motion_s(&recording, cell.rate_hz, at_s, said.t_s)
    });
    let told = match first {
        None => Told::Missed,
        Some(first) if !first.names(change, &cell) => Told::Wrong,
        Some(_) if motion_s > WITHIN_S => Told::Late,
        Some(_) => Told::Right,
    };
    let strength = cell.strength(change, &recording, at_s);
    let words: Vec<String> = said.iter().map(Said::text).collect();
    let pushed = if contacts.is_empty() { "" } else { "pushed " };
    let twin = if calibrated { "calibrated" } else { "URDF" };
    let text = format!(
        "{seed} {} joints {} Hz {twin} {pushed}{change:.2?} ({strength:.1}) at {at_s:.1}: {told:?} after {motion_s:.1} s | {}",
        cell.model.dof(),
        cell.rate_hz,
        words.join(" | ")
    );
    (
        change,
        Outcome {
            told,
            motion_s,
            strength,
            false_words: early,
            text,
        },
    )
}

/// Seeds from the environment.
fn seeds(default: Range<u64>) -> Range<u64> {
    let Ok(text) = std::env::var("WATCH_SEEDS") else {
        return default;
    };
    let (from, to) = text.split_once("..").unwrap();
    from.parse().unwrap()..to.parse().unwrap()
}

#[test]
#[ignore = "takes minutes"]
fn changes_are_named_at_their_places() {
    let mut table: BTreeMap<(&str, Told), usize> = BTreeMap::new();
    let mut false_words = 0;
    let (mut all, mut right) = (0, 0);
    let mut delays_s = Vec::new();
    for seed in seeds(1..28) {
        let (change, outcome) = run(seed);
        println!("{}", outcome.text);
        let kind = match change {
            Change::Friction(..) => "friction",
            Change::Gain(..) => "gain",
            Change::Payload(_) => "payload",
            Change::Nothing => "nothing",
        };
        *table.entry((kind, outcome.told)).or_default() += 1;
        false_words += outcome.false_words;
        let is_right = outcome.told == Told::Right;
        if is_right {
            delays_s.push(outcome.motion_s);
        }
        // For a change that is weak relative to the noise, the only requirement is that no wrong name is reported.
        if outcome.strength.is_nan() || outcome.strength >= CLEAR {
            all += 1;
            right += usize::from(is_right);
        }
    }
    delays_s.sort_by(f64::total_cmp);
    println!(
        "{table:?}; false words before the change: {false_words}; motion until it was named, median and longest: {:?} {:?} s",
        delays_s.get(delays_s.len() / 2),
        delays_s.last()
    );
    assert!(10 * right >= 9 * all, "{right} of {all}");
    assert_eq!(false_words, 0);
}

/// Contact-free recordings of some hours, one per seed.
#[test]
#[ignore = "takes minutes"]
fn clean_hours_raise_nothing() {
    let hours = std::env::var("WATCH_HOURS").map_or(0.25, |text| text.parse().unwrap());
    let mut words = Vec::new();
    for seed in seeds(1..5) {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mut cell = Cell::new(seed);
        cell.rate_hz = 50.0;
        let physics = cell.physics();
        let motion = cell.motion();
        let recording = json!({"name": "clean", "duration_s": 3600.0 * hours, "motion": motion});
        let recording = cell.simulate(folder, &physics, &recording, Change::Nothing, 0.0);
        let said = cell.watch(folder, &recording, None);
        let said: Vec<String> = said.iter().map(Said::text).collect();
        println!(
            "{seed} {} joints, {hours} h, {motion}: {said:?}",
            cell.model.dof()
        );
        words.extend(said);
    }
    assert!(words.is_empty(), "{words:?}");
}

/// The short form: a friction step, a gain step and a payload.
#[test]
fn three_changes_are_named_at_their_places() {
    for seed in [4, 12, 18] {
        let (change, outcome) = run(seed);
        assert_eq!(outcome.told, Told::Right, "{change:?}: {}", outcome.text);
        assert_eq!(outcome.false_words, 0, "{}", outcome.text);
    }
}
