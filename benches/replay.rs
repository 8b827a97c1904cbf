//! Computing time of the replay of an archive, compared with a bare read of the same file by the crate mcap, both in
//! this run and alternately.
//!
//!     cargo bench --bench replay --profile release [-- SECONDS]
//!
//! The archive is a simulated one of the bundled arm: 7 joints, 1 kHz, its states, its commands and its wrench. A
//! replay computes every event, as `tauscope replay` does, without writing a file; the last row writes the whole MCAP
//! output.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::{Replay, TwinChoice};

#[path = "common/recording.rs"]
mod recording;

use recording::{robot, simulate};

/// Number of alternating rounds; the least of the times is the one with the least other load.
const ROUNDS: usize = 7;
/// Goals of a replay \[of a bare read's speed, times real time\].
const GOAL: (f64, f64) = (0.35, 500.0);

const ONE: &str =
    "- {name: detect, input: twin, detect: {twin_regression: {}, threshold: {score: 1000}}}";
const LIGHT: &str = "\
- {name: d0, input: twin, detect: {twin_regression: {}, threshold: {score: 1000}}}
- {name: d1, input: twin, detect: {naive_difference: {}, threshold: {score: 1000}}}
- {name: d2, input: twin, detect: {momentum_observer: {}, threshold: {score: 1000}}}
- {name: d3, input: twin, detect: {contact_classifier: {}}}
- {name: d4, input: twin, detect: {frequency_classifier: {}}}";
const RECORD: &str = "\
- {name: detect, input: twin, detect: {twin_regression: {}, threshold: {score: 1000}}}
- {name: record, inputs: [in, twin, detect], record: {mcap: out.mcap}}";

fn pipeline(folder: &Path, name: &str, recording: &Path, stages: &str) -> Pipeline {
    let text = format!(
        "version: 1\ncells:\n  c: {{robot: {}}}\nstages:\n- {{name: in, cell: c, ingest: {{file: {{path: {}}}}}}}\n\
         - {{name: twin, input: in, twin: {{}}}}\n{stages}\n",
        robot().display(),
        recording.display()
    );
    let file = folder.join(name);
    std::fs::write(&file, text).expect("the folder can be written");
    Pipeline::load(&file, None).unwrap_or_else(|report| panic!("{report}"))
}

fn bare_read(recording: &Path) {
    let bytes = std::fs::read(recording).expect("the recording");
    for message in mcap::MessageStream::new(&bytes).expect("the recording") {
        black_box(message.expect("a message").data.len());
    }
}

fn seconds(work: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    work();
    begin.elapsed().as_secs_f64()
}

fn main() {
    let asked = std::env::args().skip(1).find_map(|text| text.parse().ok());
    let duration_s: u32 = asked.unwrap_or(120);
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let recording = simulate(folder, duration_s);
    let out = folder.join("out");
    let cases = [
        ("one", "twin, `twin_regression`", ONE, None),
        ("light", "twin, five light detectors", LIGHT, None),
        (
            "record",
            "twin, `twin_regression`, full MCAP output",
            RECORD,
            Some(out.as_path()),
        ),
    ]
    .map(|(file, name, stages, out)| {
        let file = format!("{file}.yaml");
        (name, pipeline(folder, &file, &recording, stages), out)
    });
    let mut bare = f64::INFINITY;
    let mut least = [f64::INFINITY; 3];
    for _ in 0..ROUNDS {
        bare = bare.min(seconds(|| bare_read(&recording)));
        for ((_, pipeline, out), least) in cases.iter().zip(&mut least) {
            let replay = Replay::new(pipeline, None, TwinChoice::Recompute).expect("one source");
            let replay = replay.reading_ahead(true);
            let took = seconds(|| {
                let outcome = replay.run(&recording, *out, &mut |_| true);
                black_box(outcome.expect("the recording"));
            });
            *least = least.min(took);
        }
    }
    let samples = f64::from(duration_s) * 1e3;
    println!("{duration_s} s of 7 joints at 1 kHz; least of {ROUNDS} rounds in turn");
    println!("| replay | µs a sample | of a bare read's speed | × real time | goal |");
    println!("| --- | --- | --- | --- | --- |");
    println!(
        "| bare read by the crate mcap (floor) | {:.2} | 1 | {:.0} | |",
        bare / samples * 1e6,
        f64::from(duration_s) / bare
    );
    for ((name, ..), least) in cases.iter().zip(least) {
        println!(
            "| {name} | {:.2} | {:.2} | {:.0} | {} |",
            least / samples * 1e6,
            bare / least,
            f64::from(duration_s) / least,
            if name.contains("output") {
                String::new()
            } else {
                format!("≥ {} and ≥ {}", GOAL.0, GOAL.1)
            }
        );
    }
}
