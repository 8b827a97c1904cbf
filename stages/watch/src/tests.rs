//! Streams with and without changes and contacts, and what the stage reports of them.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(
    clippy::needless_range_loop,
    reason = "several arrays have the same index"
)]

mod stream;

use tauscope_bus::{Detection, Emit, LinkError, Stage};

use super::{Config, Setup, Watch};
use stream::{Act, Stream};

/// A report of the stage: time \[s\], change, place and size.
#[derive(Debug, Clone)]
struct Said {
    t_s: f64,
    since_s: f64,
    state: String,
    link: String,
    joints: u32,
    size: f64,
}

impl Said {
    fn text(&self) -> String {
        let Self {
            t_s,
            since_s,
            state,
            link,
            joints,
            size,
        } = self;
        format!("{t_s:.1}: {state} {link} {joints:b} {size:.2} since {since_s:.1}")
    }
}

struct Listen<'a>(&'a mut Vec<Said>);

impl Emit<Detection> for Listen<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let mut slot = Detection::default();
        write(&mut slot);
        if slot.event == Detection::ONSET {
            self.0.push(Said {
                t_s: slot.header.stamp_ns as f64 * 1e-9 - 1.0,
                since_s: slot.contact_ns as f64 * 1e-9 - 1.0,
                state: slot.state.to_string(),
                link: slot.link.to_string(),
                joints: slot.joints,
                size: slot.size,
            });
        }
        Ok(())
    }
}

/// Returns the reports on a stream, each with the duration of motion between `since_s` and the report \[s\].
fn watch_since(stream: &mut Stream, duration_s: f64, since_s: f64) -> Vec<(Said, f64)> {
    let setup = Setup {
        model: Some(stream.nominal.clone()),
        effort_per_nm: vec![1.0; 7],
        effort_cutoff_hz: vec![4.0; 7],
    };
    let mut stage = Watch::new(&Config::default(), &setup);
    let mut said = Vec::new();
    let mut motion_s = Vec::new();
    let mut moved_s = 0.0;
    while stream.time_s() < duration_s {
        if stream.time_s() >= since_s {
            let moves = stream.is_moving();
            moved_s += if moves { 1.0 / stream.rate_hz } else { 0.0 };
        }
        let sample = stream.next_sample();
        stage.accept(&sample, &mut Listen(&mut said)).unwrap();
        motion_s.resize(said.len(), moved_s);
    }
    said.into_iter().zip(motion_s).collect()
}

fn watch(stream: &mut Stream, duration_s: f64) -> Vec<Said> {
    let said = watch_since(stream, duration_s, f64::INFINITY);
    said.into_iter().map(|(said, _)| said).collect()
}

fn texts(said: &[Said]) -> String {
    said.iter().map(Said::text).collect::<Vec<_>>().join(" | ")
}

/// End of a lasting change.
const FOR_GOOD: f64 = f64::INFINITY;

/// Changes with the expected name, joints and size of their reports.
const CHANGES: [(Act, &str, u32, f64); 7] = [
    (Act::Viscous(3, 4.0), "viscous_friction", 0b1000, 4.0),
    (Act::Coulomb(2, 1.0), "coulomb_friction", 0b100, 1.0),
    (Act::Coulomb(1, 1.0), "coulomb_friction", 0b10, 1.0),
    (Act::Coulomb(5, 0.5), "coulomb_friction", 0b10_0000, 0.5),
    (Act::Payload(1.0, [0.0, 0.02, 0.08]), "payload", 0, 1.0),
    (Act::Gain(1, 1.08), "torque_gain", 0b10, 1.08),
    (Act::Gain(3, 0.9), "torque_gain", 0b1000, 0.9),
];

#[test]
fn a_change_is_named_at_its_place_within_ten_seconds_of_motion() {
    for calibrated in [true, false] {
        for (act, name, joints, size) in CHANGES {
            let from_s = 60.0;
            let mut stream = Stream::new(3).with(act, from_s, FOR_GOOD);
            stream.calibrated = calibrated;
            let said = watch_since(&mut stream, 80.0, from_s);
            let (first, motion_s) = said.first().unwrap_or_else(|| panic!("{act:?}: nothing"));
            let text = first.text();
            assert_eq!(first.state, name, "{act:?}: {text}");
            if name == "payload" {
                assert_eq!(first.link, "tool", "{act:?}: {text}");
            } else {
                assert_eq!(first.joints, joints, "{act:?}: {text}");
            }
            assert!((first.size - size).abs() < 0.1 * size, "{act:?}: {text}");
            assert!((first.since_s - from_s).abs() < 1.5, "{act:?}: {text}");
            assert!(
                *motion_s <= 10.0,
                "{act:?}: {text} after {motion_s} s of motion"
            );
            assert_eq!(said.len(), 1, "{act:?}: more than once");
        }
    }
}

#[test]
fn a_watch_that_is_started_again_goes_on_watching() {
    let setup = |stream: &Stream| Setup {
        model: Some(stream.nominal.clone()),
        effort_per_nm: vec![1.0; 7],
        effort_cutoff_hz: vec![4.0; 7],
    };
    let mut stream = Stream::new(3).with(Act::Coulomb(1, 1.0), 110.0, FOR_GOOD);
    let mut said = Vec::new();
    let mut first = Watch::new(&Config::default(), &setup(&stream));
    assert!(first.learnt().is_none() && first.is_learning());
    while stream.time_s() < 100.0 {
        let sample = stream.next_sample();
        first.accept(&sample, &mut Listen(&mut said)).unwrap();
    }
    let memory = first.learnt().unwrap();
    assert!(memory.fits(7) && !memory.fits(6));
    let mut second = Watch::new(&Config::default(), &setup(&stream)).resumed(&memory);
    assert!(!second.is_learning());
    assert_eq!(second.learnt().as_ref(), Some(&memory));
    while stream.time_s() < 135.0 {
        let sample = stream.next_sample();
        second.accept(&sample, &mut Listen(&mut said)).unwrap();
    }
    assert_eq!(said.len(), 1, "{}", texts(&said));
    assert_eq!(said[0].state, "coulomb_friction", "{}", texts(&said));
}

#[test]
fn a_contact_is_not_taken_for_a_change() {
    for (link, force, duration_s) in [
        (6, [0.0, 15.0, -13.0], 1.0),
        (6, [0.0, 15.0, -13.0], 5.0),
        (6, [0.0, 0.0, -20.0], 5.0),
        (4, [20.0, 0.0, 0.0], 5.0),
        (6, [14.0, 14.0, 0.0], 8.0),
    ] {
        for seed in 1..=3 {
            let push = Act::Push(link, force);
            let mut stream = Stream::new(seed).with(push, 60.0, 60.0 + duration_s);
            let said = watch(&mut stream, 90.0);
            let all = texts(&said);
            let contact = said.iter().all(|said| said.state == "contact");
            assert!(contact, "{push:?} {duration_s} s: {all}");
            assert_eq!(said.len(), 1, "{push:?} {duration_s} s: {all}");
            assert!((said[0].since_s - 60.0).abs() < 1.0, "{all}");
        }
    }
}

/// A calibrated twin (`true`) with the period between motion changes \[s\]: never.
const ONE_PROGRAM: [(bool, f64); 1] = [(true, f64::INFINITY)];
/// Uncalibrated rigid-body twins with motions that change.
const NEW_PROGRAMS: [(bool, f64); 2] = [(false, 12.0), (false, 300.0)];

/// Returns the reports over hours of motion of an arm that warms up, as lines of text.
fn clean(seed: u64, hours: f64, programs: &[(bool, f64)]) -> String {
    let mut all = String::new();
    for &(calibrated, program_s) in programs {
        let mut stream = Stream::new(seed);
        stream.calibrated = calibrated;
        stream.program_s = program_s;
        stream.rest_s = if seed.is_multiple_of(2) { 0.7 } else { 0.0 };
        stream.noise = [0.0005, 0.001, 0.003][seed as usize % 3];
        stream.warm_up = 0.4;
        stream.rate_hz = 50.0;
        let said = watch(&mut stream, 3600.0 * hours);
        if !said.is_empty() {
            all += &format!("seed {seed}, {program_s} s: {}\n", texts(&said));
        }
    }
    all
}

#[test]
fn twenty_clean_minutes_raise_nothing() {
    assert_eq!(clean(1, 1.0 / 3.0, &ONE_PROGRAM), "");
    assert_eq!(clean(1, 1.0 / 3.0, &NEW_PROGRAMS), "");
}

/// Eight arms with a calibrated twin.
#[test]
#[ignore = "takes minutes"]
fn eight_clean_hours_of_one_program_raise_nothing() {
    let all: String = (101..109)
        .map(|seed| clean(seed, 8.0, &ONE_PROGRAM))
        .collect();
    assert_eq!(all, "");
}

#[test]
fn a_change_is_told_once_and_the_next_again() {
    let mut stream = Stream::new(3)
        .with(Act::Coulomb(2, 1.0), 60.0, FOR_GOOD)
        .with(Act::Payload(1.0, [0.0, 0.0, 0.05]), 160.0, FOR_GOOD);
    let said = watch(&mut stream, 200.0);
    let names: Vec<&str> = said.iter().map(|said| said.state.as_str()).collect();
    assert_eq!(names, ["coulomb_friction", "payload"], "{}", texts(&said));
}

#[test]
fn an_arm_that_warmed_up_for_half_an_hour_is_still_watched() {
    let from_s = 1800.0;
    let mut stream = Stream::new(3).with(Act::Coulomb(2, 1.0), from_s, FOR_GOOD);
    stream.warm_up = 0.4;
    stream.rate_hz = 50.0;
    let said = watch(&mut stream, from_s + 20.0);
    assert_eq!(said.len(), 1, "{}", texts(&said));
    assert_eq!(said[0].state, "coulomb_friction", "{}", texts(&said));
    assert_eq!(said[0].joints, 0b100, "{}", texts(&said));
}

#[test]
fn standstill_and_nonsense_say_nothing() {
    let mut stream = Stream::new(1);
    let setup = Setup {
        model: None,
        effort_per_nm: vec![f64::NAN; 7],
        effort_cutoff_hz: vec![4.0; 7],
    };
    let mut stage = Watch::new(&Config::default(), &setup);
    let mut said = Vec::new();
    for step in 0..20_000 {
        let mut sample = stream.next_sample();
        match step % 1000 {
            0 => sample.residual[3] = f64::NAN,
            1 => sample.header.stamp_ns = 0,
            _ if step > 10_000 => sample.velocity = Default::default(),
            _ => {}
        }
        stage.accept(&sample, &mut Listen(&mut said)).unwrap();
    }
    assert!(said.is_empty(), "{}", texts(&said));
}

/// Prints delay, names and cost: `cargo test --release -p tauscope-watch -- --ignored
/// --nocapture figures`.
#[test]
#[ignore = "prints"]
fn figures() {
    let from_s = 60.0;
    for (act, name, joints, _) in CHANGES {
        let (mut right, mut delays, mut wrong) = (0, Vec::new(), Vec::new());
        let runs = 20;
        for seed in 1..=runs {
            let mut stream = Stream::new(seed).with(act, from_s, FOR_GOOD);
            stream.calibrated = seed % 2 == 0;
            let said = watch_since(&mut stream, 90.0, from_s);
            match said.iter().find(|(said, _)| said.state != "contact") {
                Some((said, motion_s))
                    if said.state == name && (name == "payload" || said.joints == joints) =>
                {
                    right += 1;
                    delays.push(*motion_s);
                }
                Some((said, _)) => wrong.push(format!("seed {seed}: {}", said.text())),
                None => wrong.push(format!("seed {seed}: nothing")),
            }
            let contacts = said.iter().filter(|(said, _)| said.state == "contact");
            wrong.extend(contacts.map(|(said, _)| format!("seed {seed}: {}", said.text())));
        }
        delays.sort_by(f64::total_cmp);
        let worst = delays.last().copied().unwrap_or(f64::NAN);
        let median = delays.get(delays.len() / 2).copied().unwrap_or(f64::NAN);
        println!(
            "{act:?}: {right} of {runs}, {median:.1} s of motion, worst {worst:.1} s; {wrong:?}"
        );
    }
    for (link, force, duration_s) in [
        (6, [0.0, 15.0, -13.0], 1.0),
        (6, [0.0, 15.0, -13.0], 5.0),
        (6, [0.0, 0.0, -20.0], 5.0),
        (4, [20.0, 0.0, 0.0], 5.0),
        (6, [14.0, 14.0, 0.0], 8.0),
    ] {
        let mut counts = std::collections::BTreeMap::new();
        for seed in 1..=60 {
            let mut stream =
                Stream::new(seed).with(Act::Push(link, force), 60.0, 60.0 + duration_s);
            for said in watch(&mut stream, 90.0) {
                if said.state != "contact" {
                    println!("seed {seed}: {}", said.text());
                }
                *counts.entry(said.state).or_insert(0) += 1;
            }
        }
        println!("{force:?} N at link {link} for {duration_s} s, 60 runs: {counts:?}");
    }
    let mut stream = Stream::new(1);
    stream.rate_hz = 500.0;
    let samples: Vec<_> = (0..60_000).map(|_| stream.next_sample()).collect();
    let setup = Setup {
        model: Some(stream.nominal.clone()),
        effort_per_nm: vec![1.0; 7],
        effort_cutoff_hz: vec![4.0; 7],
    };
    let mut stage = Watch::new(&Config::default(), &setup);
    let start = std::time::Instant::now();
    let mut said = Vec::new();
    let mut each = Vec::with_capacity(samples.len());
    for sample in &samples {
        let begin = std::time::Instant::now();
        stage.accept(sample, &mut Listen(&mut said)).unwrap();
        each.push(begin.elapsed());
    }
    let mean = start.elapsed() / samples.len() as u32;
    each.sort();
    let slow = each[each.len() * 999 / 1000];
    println!("500 Hz: {mean:?} a sample on average, 99.9 % within {slow:?}");
}

/// Prints the reports of the eight arms when the motion changes occasionally. A few reports are expected.
#[test]
#[ignore = "prints"]
fn new_programs() {
    let all: String = (101..109)
        .map(|seed| clean(seed, 8.0, &NEW_PROGRAMS))
        .collect();
    println!("{all}");
}

/// Prints the reports over many hours of streams without changes, most of them with much less noise than real ones.
#[test]
#[ignore = "prints"]
fn quiet() {
    let hours = 2.0;
    let mut total = 0;
    for (calibrated, program_s, rest_s, noise) in [
        (true, 300.0, 0.0, 0.0005),
        (false, 300.0, 0.0, 0.003),
        (true, 300.0, 0.0, 0.001),
        (true, f64::INFINITY, 0.0, 0.003),
        (true, f64::INFINITY, 0.0, 0.0005),
        (false, f64::INFINITY, 1.0, 0.0005),
        (true, 12.0, 0.0, 0.003),
        (true, 12.0, 0.5, 0.0005),
        (false, 12.0, 0.5, 0.0005),
        (true, 300.0, 0.0, 0.0005),
        (false, 300.0, 0.0, 0.003),
        (true, 60.0, 2.0, 0.003),
    ] {
        for seed in 1..=4 {
            let mut stream = Stream::new(seed);
            stream.calibrated = calibrated;
            stream.program_s = program_s;
            stream.rest_s = rest_s;
            stream.warm_up = 0.4;
            stream.noise = noise;
            stream.rate_hz = 25.0;
            let said = watch(&mut stream, hours * 3600.0);
            total += said.len();
            println!("{calibrated} {program_s} {noise} {seed}: {}", texts(&said));
        }
    }
    println!("{total} reports in {} h", 36.0 * hours);
}
