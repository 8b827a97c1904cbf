//! Computing time of a sample in twin and detector, compared with its floor, the inverse dynamics alone. Also the
//! time of a replay's source, compared with a bare read of the same archive.
//!
//!     cargo bench --bench chain
//!
//! Percentiles are given, because the mean is not informative on a machine that runs other programs.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use hdrhistogram::Histogram;
use tauscope_archive::Recording;
use tauscope_bus::{
    Detection, Emit, JointState, LinkError, Progress, Sample, Source, Stage, TwinState,
};
use tauscope_dynamics::{Data, Model, rnea};
use tauscope_ingest::{Config, FileConfig, RecordedSource, Setup, Topics};

/// Number of passes over the recording.
const ROUNDS: usize = 20;

/// Receives samples and keeps only the newest.
#[derive(Default)]
struct Slot<T>(T);

impl<T: Sample> Emit<T> for Slot<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.0 = T::default();
        write(&mut self.0);
        Ok(())
    }
}

/// Receives and keeps all samples.
#[derive(Default)]
struct Kept(Vec<JointState>);

impl Emit<JointState> for Kept {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let mut sample = JointState::default();
        write(&mut sample);
        self.0.push(sample);
        Ok(())
    }
}

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn source(joint_names: &[String]) -> RecordedSource {
    let file = FileConfig {
        path: data().join("demo.mcap"),
        topics: Topics::default(),
    };
    let setup = Setup {
        effort_limits: Vec::new(),
        cell: "demo".to_owned(),
        joint_names: joint_names.to_vec(),
        tool: None,
        has_tool_link: false,
    };
    RecordedSource::open_file(&file, &Config::default(), &setup).expect("the bundled recording")
}

fn histogram() -> Histogram<u64> {
    Histogram::new(3).expect("three digits are allowed")
}

fn timed(histogram: &mut Histogram<u64>, work: impl FnOnce()) {
    let start = Instant::now();
    work();
    let _ = histogram.record(start.elapsed().as_nanos() as u64);
}

fn main() {
    let urdf = std::fs::read_to_string(data().join("demo_arm.urdf")).expect("the bundled robot");
    let model = Model::from_urdf(&urdf).expect("the bundled robot");
    let joint_names: Vec<String> = model.joint_names().map(str::to_owned).collect();
    let n = joint_names.len();

    let mut kept = Kept::default();
    let mut recorded = source(&joint_names);
    while recorded.step(&mut kept).expect("the bundled recording") != Progress::End {}

    let [mut clock, mut floor, mut twin_cost, mut detect_cost] = [(); 4].map(|()| histogram());
    let mut data_ = Data::new(&model);
    for _ in 0..ROUNDS {
        let setup = tauscope_twin::Setup {
            model: Some(model.clone()),
            joint_names: joint_names.clone(),
            torque_constants_nm_per_a: None,
            tool_link: None,
        };
        let correction = tauscope_twin::Correction::none(n);
        let config = tauscope_twin::Config::default();
        let mut twin = tauscope_twin::Twin::new(&config, setup, correction).expect("a twin");
        let config = tauscope_detect::Config {
            threshold: tauscope_detect::Threshold {
                score: Some(40.0),
                sigmas: None,
            },
            ..tauscope_detect::Config::of(
                tauscope_detect::tajiri::twin_regression::Settings::default(),
            )
        };
        let joint = tauscope_detect::JointSetup {
            gain: 1.0,
            offset: 0.0,
            noise: Some(1.0),
            effort_per_nm: 1.0,
        };
        let setup = tauscope_detect::Setup {
            joints: vec![joint; n],
            model: Some(model.clone()),
            ..tauscope_detect::Setup::default()
        };
        let mut detect = config.stage(setup).expect("a detector");
        let (mut twin_state, mut detection) =
            (Slot(TwinState::default()), Slot(Detection::default()));
        for sample in &kept.0 {
            timed(&mut clock, || {});
            timed(&mut floor, || {
                let (q, qd) = (&sample.position[..n], &sample.velocity[..n]);
                black_box(rnea(
                    &model,
                    &mut data_,
                    black_box(q),
                    black_box(qd),
                    black_box(qd),
                ));
            });
            timed(&mut twin_cost, || {
                twin.accept(black_box(sample), &mut twin_state)
                    .expect("no link can fail");
            });
            timed(&mut detect_cost, || {
                detect
                    .accept(black_box(&twin_state.0), &mut detection)
                    .expect("no link can fail");
            });
            black_box(&detection.0);
        }
    }
    println!(
        "per sample of {n} joints, {} samples [ns]        p50    p90    p99",
        clock.len()
    );
    for (name, histogram) in [
        ("the clock itself", &clock),
        ("RNEA alone (floor)", &floor),
        ("twin", &twin_cost),
        ("detect: twin_regression", &detect_cost),
    ] {
        let [p50, p90, p99] = [0.5, 0.9, 0.99].map(|q| histogram.value_at_quantile(q));
        println!("{name:<44} {p50:>6} {p90:>6} {p99:>6}");
    }
    let median = |histogram: &Histogram<u64>| {
        histogram
            .value_at_quantile(0.5)
            .saturating_sub(clock.value_at_quantile(0.5))
            .max(1) as f64
    };
    println!(
        "twin / RNEA, medians less the clock's: {:.2}",
        median(&twin_cost) / median(&floor)
    );

    whole_recording(&joint_names);
}

/// Times a replay's source and a bare read of the same archive.
fn whole_recording(joint_names: &[String]) {
    let (mut bare, mut chain) = (histogram(), histogram());
    for _ in 0..ROUNDS {
        timed(&mut bare, || {
            let recording = Recording::open(data().join("demo.mcap")).expect("the recording");
            let mut messages = recording.all_messages().expect("the recording");
            while let Some(message) = messages.next_message() {
                black_box(message.expect("a message").body);
            }
        });
        timed(&mut chain, || {
            let mut kept = Slot(JointState::default());
            let mut recorded = source(joint_names);
            while recorded.step(&mut kept).expect("the recording") != Progress::End {}
        });
    }
    let [bare, ingest] = [&bare, &chain].map(|h| h.value_at_quantile(0.5) as f64 * 1e-6);
    println!(
        "whole recording, median [ms]: bare read of all topics {bare:.2}, ingest {ingest:.2}, ratio {:.2}",
        ingest / bare
    );
}
