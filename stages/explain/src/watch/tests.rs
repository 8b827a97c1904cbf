//! Streams in which something happens, and streams in which nothing does.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod stream;

use tauscope_bus::{Detection, Emit, LinkError, Stage};

use super::{Config, Setup, Watch};
use stream::{Act, Stream};

/// What the stage said: when \[s\], what, where.
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

fn watch(stream: &mut Stream, duration_s: f64) -> Vec<Said> {
    let setup = Setup {
        model: Some(stream.nominal.clone()),
        effort_per_nm: vec![1.0; 7],
        effort_cutoff_hz: 4.0,
    };
    let mut stage = Watch::new(&Config::default(), &setup);
    let mut said = Vec::new();
    while stream.time_s() < duration_s {
        let sample = stream.next();
        stage.accept(&sample, &mut Listen(&mut said)).unwrap();
    }
    said
}

#[test]
#[ignore = "prints"]
fn figures() {
    let end = f64::INFINITY;
    for calibrated in [true, false] {
        for seed in 1..=4 {
            for (label, act, until) in [
                ("coulomb 1 @3", Act::Coulomb(2, 1.0), end),
                ("coulomb 1 @2", Act::Coulomb(1, 1.0), end),
                ("coulomb .5 @6", Act::Coulomb(5, 0.5), end),
                ("viscous 1 @2", Act::Viscous(1, 1.0), end),
                ("payload 1", Act::Payload(1.0, [0.0, 0.02, 0.08]), end),
                ("payload .5", Act::Payload(0.5, [0.0, 0.0, 0.05]), end),
                ("gain 1.08 @2", Act::Gain(1, 1.08), end),
                ("gain 1.08 @4", Act::Gain(3, 1.08), end),
                ("gain .9 @4", Act::Gain(3, 0.9), end),
                ("push 1 s 20 N", Act::Push(6, [0.0, 15.0, -13.0]), 41.0),
                ("push 5 s 20 N", Act::Push(6, [0.0, 15.0, -13.0]), 45.0),
                ("push 5 s 20 N l4", Act::Push(4, [20.0, 0.0, 0.0]), 45.0),
                ("push 8 s 20 N", Act::Push(6, [14.0, 14.0, 0.0]), 48.0),
            ] {
                let mut stream = Stream::new(seed).with(act, 40.0, until);
                stream.calibrated = calibrated;
                let said = watch(&mut stream, 90.0);
                let text: Vec<String> = said.iter().map(Said::text).collect();
                println!("{calibrated} {seed} {label:18} {}", text.join(" | "));
            }
        }
    }
}

#[test]
#[ignore = "prints"]
fn quiet() {
    let hours: f64 = 2.0;
    let mut total = 0;
    for (calibrated, program_s, rest_s, noise) in [
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
            let changes: Vec<String> = (said.iter().filter(|s| s.state != "contact"))
                .map(Said::text)
                .collect();
            total += said.len();
            println!(
                "{calibrated} {program_s} {noise} {seed} contacts {} changes {} {}",
                said.len() - changes.len(),
                changes.len(),
                changes[..changes.len().min(6)].join(" | ")
            );
        }
    }
    println!("{total} words in {} h", 36.0 * hours);
}
