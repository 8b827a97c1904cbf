//! Latency from ingest to alarm in a running pipeline at 1 kHz, compared with the same number of hops of bare
//! iceoryx2, both in this run and alternately.
//!
//!     cargo bench --bench live --profile release [-- SECONDS]
//!
//! `tauscope run` plays a recording in real time. A stage of this program receives each sample, as a source receives
//! the robot's messages, and writes the time into it. The twin and the detector process it. A second stage of this
//! program reads the detector's output with `keep: newest`, as a publisher does, and reads the clock again. The floor
//! sends the largest of these samples over the same number of hops through the same number of processes, without
//! processing them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use hdrhistogram::Histogram;
use tauscope_bus::{
    Detection, Domain, Emit, JointState, Sample as _, Seat, Stage, StageError, shell,
};

#[path = "../bus/benches/common/bare.rs"]
mod bare;
#[path = "common/recording.rs"]
mod recording;

use bare::{BareReceiver, BareSender};

/// Number of turns in which each chain is measured, so that all chains see the same machine load.
const TURNS: usize = 5;
/// Number of samples at the beginning of a turn that are not counted: processes start, caches fill.
const WARM_UP: usize = 2_000;
/// Largest latency relative to the floor.
const GOAL: f64 = 1.2;

/// A pipeline whose latency is measured.
struct Shape {
    name: &'static str,
    /// Connections between processes from the first stamp to the second.
    hops: usize,
    /// Keys of the twin and the detector for their processes.
    twin: &'static str,
    detect: &'static str,
    /// Wake mode of the first of them.
    wake: &'static str,
    recorder: bool,
}

const SHAPES: [Shape; 5] = [
    Shape {
        name: "twin and detector in one process",
        hops: 2,
        twin: "chain",
        detect: "chain",
        wake: "event",
        recorder: false,
    },
    Shape {
        name: "the same, with a recorder",
        hops: 2,
        twin: "chain",
        detect: "chain",
        wake: "event",
        recorder: true,
    },
    Shape {
        name: "the same without a recorder, polling continuously",
        hops: 2,
        twin: "chain",
        detect: "chain",
        wake: "spin",
        recorder: false,
    },
    Shape {
        name: "a process for each stage",
        hops: 3,
        twin: "twin",
        detect: "detect",
        wake: "event",
        recorder: false,
    },
    Shape {
        name: "the same, with a recorder",
        hops: 3,
        twin: "twin",
        detect: "detect",
        wake: "event",
        recorder: true,
    },
];

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let words: Vec<_> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["stamp"] => shell::outside(|_: &Seat| Ok::<_, std::convert::Infallible>(Stamp)),
        ["end"] => shell::outside(Arrivals::of),
        ["hop", place, from, to, stamp] => {
            hop(place, from, to, *stamp == "stamp");
            ExitCode::SUCCESS
        }
        _ => {
            let seconds = words.iter().find_map(|word| word.parse().ok());
            measure(seconds.unwrap_or(100));
            ExitCode::SUCCESS
        }
    }
}

fn measure(seconds: u32) {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let turn_s = seconds.div_ceil(TURNS as u32) + WARM_UP as u32 / 1000;
    let recording = recording::simulate(folder, turn_s);
    let mut floors = [2, 3].map(|hops| (hops, histogram()));
    let mut found = SHAPES.map(|shape| (shape, histogram()));
    for _ in 0..TURNS {
        for (hops, latencies) in &mut floors {
            add(latencies, &bare_chain(*hops, turn_s));
        }
        for (shape, latencies) in &mut found {
            add(latencies, &pipeline(folder, &recording, shape));
        }
    }
    println!("1 kHz, 7 joints, {TURNS} turns; from the first stamp to the second [µs]");
    println!("| chain | samples | p50 | p90 | p99 | of bare, p50 | of bare, p99 | goal |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (hops, latencies) in &floors {
        let name = format!("{hops} bare hops (floor)");
        row(&name, latencies, latencies, "");
        for (shape, latencies) in found.iter().filter(|(shape, _)| shape.hops == *hops) {
            let floor = &floors
                .iter()
                .find(|(of, _)| of == hops)
                .expect("its floor")
                .1;
            row(shape.name, latencies, floor, &format!("≤ {GOAL} at p99"));
        }
    }
}

fn row(name: &str, latencies: &Histogram<u64>, floor: &Histogram<u64>, goal: &str) {
    let at = |histogram: &Histogram<u64>, q| histogram.value_at_quantile(q) as f64 / 1e3;
    let ratio = |q| at(latencies, q) / at(floor, q);
    println!(
        "| {name} | {} | {:.1} | {:.1} | {:.1} | {:.2} | {:.2} | {goal} |",
        latencies.len(),
        at(latencies, 0.5),
        at(latencies, 0.9),
        at(latencies, 0.99),
        ratio(0.5),
        ratio(0.99),
    );
}

fn histogram() -> Histogram<u64> {
    Histogram::new(3).expect("three digits are allowed")
}

fn add(histogram: &mut Histogram<u64>, latencies_ns: &[u64]) {
    for &ns in latencies_ns.iter().skip(WARM_UP) {
        histogram.record(ns).expect("it grows as it must");
    }
}

/// Time of this machine's clock, which its processes share \[ns since the epoch\].
fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.expect("a time after 1970").as_nanos() as i64
}

/// Writes the time of arrival into each sample.
struct Stamp;

impl Stage<JointState, JointState> for Stamp {
    fn accept(
        &mut self,
        state: &JointState,
        out: &mut dyn Emit<JointState>,
    ) -> Result<(), StageError> {
        out.emit(&mut |slot| {
            *slot = *state;
            slot.header_mut().received_ns = now_ns();
        })?;
        Ok(())
    }
}

/// Records the time of arrival of each detection.
struct Arrivals {
    latencies_ns: Vec<u64>,
    file: PathBuf,
}

impl Arrivals {
    fn of(seat: &Seat) -> Result<Self, serde_json::Error> {
        Ok(Self {
            latencies_ns: Vec::with_capacity(1 << 20),
            file: serde_json::from_value(seat.config.clone())?,
        })
    }
}

impl Stage<Detection, Detection> for Arrivals {
    fn accept(&mut self, found: &Detection, _: &mut dyn Emit<Detection>) -> Result<(), StageError> {
        let took = now_ns() - found.header.received_ns;
        self.latencies_ns.push(took.max(0) as u64);
        Ok(())
    }

    fn finish(&mut self, _: &mut dyn Emit<Detection>) -> Result<(), StageError> {
        write(&self.file, &self.latencies_ns);
        Ok(())
    }
}

fn write(file: &Path, latencies_ns: &[u64]) {
    let lines: Vec<_> = latencies_ns.iter().map(u64::to_string).collect();
    std::fs::write(file, lines.join("\n")).expect("the folder can be written");
}

fn read(file: &Path) -> Vec<u64> {
    let text = std::fs::read_to_string(file).expect("what the last stage wrote");
    let numbers = text.lines().map(|line| line.parse().expect("a number"));
    numbers.collect()
}

/// Runs the pipeline once and returns the latency of each sample \[ns\].
fn pipeline(folder: &Path, recording: &Path, shape: &Shape) -> Vec<u64> {
    let me = std::env::current_exe().expect("this program");
    let arrivals = folder.join("arrivals");
    let recorder = if shape.recorder {
        "- {name: record, inputs: [in, twin, detect], record: {mcap: 'out-{n}.mcap'}}\n"
    } else {
        ""
    };
    let text = format!(
        "version: 1\ncells: {{c: {{robot: {}}}}}\nstages:\n\
         - {{name: play, cell: c, process: play, ingest: {{file: {{path: {}}}}}}}\n\
         - {{name: in, input: play, outside: {{command: [{me}, stamp], output: joint_state}}}}\n\
         - {{name: twin, input: in, process: {}, wake: {}, twin: {{}}}}\n\
         - {{name: detect, input: twin, process: {}, detect: {{twin_regression: {{}}, threshold: {{score: 1000}}}}}}\n\
         - {{name: end, input: detect, keep: newest, outside: {{command: [{me}, end], output: detection, settings: {}}}}}\n{recorder}",
        recording::robot().display(),
        recording.display(),
        shape.twin,
        shape.wake,
        shape.detect,
        arrivals.display(),
        me = me.display(),
    );
    let file = folder.join("pipeline.yaml");
    std::fs::write(&file, text).expect("the folder can be written");
    let arguments = [OsStr::new("run"), OsStr::new("--quiet"), file.as_os_str()];
    let run = Command::new(env!("CARGO_BIN_EXE_tauscope"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("tauscope");
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    read(&arrivals)
}

/// Measures a chain of the same number of processes as the pipeline, which only pass a sample on: one sends a
/// thousand samples per second, one writes the time into them, `hops - 1` are in between, and this one reads the
/// clock again.
fn bare_chain(hops: usize, seconds: u32) -> Vec<u64> {
    let domain = Domain::unique();
    let place = domain.as_str();
    let last = format!("h{hops}");
    let mut end = BareReceiver::open(place, &last, true);
    let mut processes: Vec<Child> = Vec::new();
    for place_in_chain in (0..hops).rev() {
        let (from, to) = (
            format!("h{place_in_chain}"),
            format!("h{}", place_in_chain + 1),
        );
        let stamp = if place_in_chain == 0 { "stamp" } else { "pass" };
        processes.push(other(&["hop", place, &from, &to, stamp]));
    }
    let mut first = BareSender::open(place, "h0", true);
    let samples = seconds as usize * 1000;
    let mut latencies_ns = Vec::with_capacity(samples);
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let begin = Instant::now();
            for number in 0..=samples {
                let due = begin + Duration::from_millis(number as u64);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                // The last sample ends the chain.
                let stamp_ns = if number == samples { -1 } else { number as i64 };
                first.send(|sample| sample.header.stamp_ns = stamp_ns);
            }
        });
        while let Some(ns) = end.receive(|sample| {
            let took = now_ns() - sample.header.received_ns;
            (sample.header.stamp_ns >= 0).then_some(took.max(0) as u64)
        }) {
            latencies_ns.push(ns);
        }
    });
    for mut process in processes {
        process.wait().expect("a process that ends");
    }
    drop(end);
    domain.remove().expect("an empty folder");
    latencies_ns
}

fn other(arguments: &[&str]) -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args(arguments)
        .stdin(Stdio::null())
        .spawn()
        .expect("this program")
}

/// Passes samples on, with the time if `stamp` is set.
fn hop(place: &str, from: &str, to: &str, stamp: bool) {
    let mut input = BareReceiver::open(place, from, true);
    let mut output = BareSender::open(place, to, true);
    loop {
        let stamp_ns = input.receive(|sample| {
            output.send(|slot| {
                *slot = *sample;
                if stamp {
                    slot.header_mut().received_ns = now_ns();
                }
            });
            sample.header.stamp_ns
        });
        if stamp_ns < 0 {
            return;
        }
    }
}
