//! Computing time per sample of the detectors without a network: of each detector as a separate stage, and of all
//! detectors behind one twin in one process, with and without shared values. The inverse dynamics alone is the lower
//! bound.
//!
//!     cargo bench -p tauscope-detect --bench light_detectors
//!
//! The bundled arm of 7 joints swings at 1 kHz. During an alarm, link and force are also estimated; this is
//! measured on the same motion with pushes.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use hdrhistogram::Histogram;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{Detection, Emit, LinkError, Stage, TwinState, flags};
use tauscope_detect::frame::Discriminant;
use tauscope_detect::indri::{virtual_collision_sensor, virtual_collision_sensor_basic};
use tauscope_detect::salt_ducaju::{contact_classifier, fisher_discriminant, frequency_classifier};
use tauscope_detect::tajiri::{momentum_observer, naive_difference, twin_regression};
use tauscope_detect::{
    Config, Detect, JointSetup, Lesson, Lessons, Setup, Shared, Threshold, tauscope,
};
use tauscope_dynamics::{Data, Model, rnea};

const SAMPLES: i64 = 20_000;
const STEP_NS: i64 = 1_000_000;
/// Period of the pushes \[samples\]; a push lasts for the last tenth of it.
const PUSH_EVERY: i64 = 2000;
const PUSH_NM: f64 = 5.0;
/// Number of passes over the samples.
const ROUNDS: usize = 10;

/// Keeps the newest detection.
#[derive(Default)]
struct Slot(Detection);

impl Emit<Detection> for Slot {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        self.0 = Detection::default();
        write(&mut self.0);
        Ok(())
    }
}

/// Returns a twin's samples of the swinging arm, with pushes if `pushed`.
fn samples(model: &Model, pushed: bool) -> Vec<TwinState> {
    let n = model.dof();
    let mut data = Data::new(model);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let sample = |k: i64| {
        let mut sample = TwinState::default();
        sample.header.stamp_ns = k * STEP_NS;
        sample.header.joint_count = n as u32;
        sample.header.flags = flags::READY;
        let t = 1e-9 * sample.header.stamp_ns as f64;
        for j in 0..n {
            let omega = 1.0 + 0.2 * j as f64;
            let (sin, cos) = (omega * t).sin_cos();
            sample.position[j] = 0.5 * sin + 0.3;
            sample.velocity[j] = 0.5 * omega * cos;
            sample.acceleration[j] = -0.5 * omega * omega * sin;
        }
        let (q, qd, qdd) = (&sample.position, &sample.velocity, &sample.acceleration);
        let expected = rnea(model, &mut data, &q[..n], &qd[..n], &qdd[..n]);
        sample.expected_effort[..n].copy_from_slice(expected);
        sample.effort = sample.expected_effort;
        let is_push = pushed && k % PUSH_EVERY >= PUSH_EVERY * 9 / 10;
        for effort in &mut sample.effort[..n] {
            *effort += random.random_range(-0.1..0.1) - if is_push { PUSH_NM } else { 0.0 };
        }
        sample.filtered_effort = sample.effort;
        sample.filtered_expected_effort = sample.expected_effort;
        for j in 0..n {
            sample.residual[j] = sample.effort[j] - sample.expected_effort[j];
        }
        sample
    };
    (0..SAMPLES).map(sample).collect()
}

/// Returns one configuration per detector.
fn configs(joints: usize, setup: &Setup, free: &[TwinState]) -> Vec<Config> {
    let free = [Lesson {
        name: "free".to_owned(),
        samples: free.to_vec(),
        contacts: Some(Vec::new()),
    }];
    let lessons = Lessons {
        train: &free,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), setup, &lessons);
    let bias = vec![0.5; joints];
    let bias = Some(virtual_collision_sensor::FirstBias::InOrder(bias));
    let threshold = Threshold {
        score: Some(100.0),
        sigmas: None,
    };
    let scored = Config {
        threshold,
        ..Config::default()
    };
    vec![
        scored.clone().with(twin_regression::Settings::default()),
        scored.clone().with(naive_difference::Settings::default()),
        scored.with(momentum_observer::Settings::default()),
        Config::of(virtual_collision_sensor_basic::Settings {
            bias: bias.clone(),
            ..Default::default()
        }),
        Config::of(virtual_collision_sensor::Settings {
            bias,
            learn: virtual_collision_sensor::Learn::AtStart,
            learning_s: 1.0,
            ..Default::default()
        }),
        Config::of(contact_classifier::Settings::default()),
        Config::of(fisher_discriminant::Settings {
            discriminant: Some(Discriminant {
                weights: [-1.0; 6],
                bound: 0.0,
            }),
            ..Default::default()
        }),
        Config::of(frequency_classifier::Settings::default()),
        Config::of(learnt.expect("20 s of contact-free samples")),
    ]
}

fn histogram() -> Histogram<u64> {
    Histogram::new(3).expect("three digits are allowed")
}

fn elapsed_ns(work: impl FnOnce()) -> u64 {
    let start = Instant::now();
    work();
    start.elapsed().as_nanos() as u64
}

fn timed(histogram: &mut Histogram<u64>, work: impl FnOnce()) {
    let _ = histogram.record(elapsed_ns(work));
}

/// Returns a copy of the sample that is in the cache, as it is after a twin has written it.
fn warm(sample: &TwinState) -> TwinState {
    black_box(*sample)
}

fn accept(detect: &mut Detect, sample: &TwinState, out: &mut Slot) {
    detect
        .accept(black_box(sample), out)
        .expect("no link can fail");
    black_box(&out.0);
}

fn main() {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/demo_arm.urdf");
    let urdf = std::fs::read_to_string(urdf).expect("the bundled robot");
    let model = Model::from_urdf(&urdf).expect("the bundled robot");
    let n = model.dof();
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.06),
        effort_per_nm: 1.0,
    };
    let setup = Setup {
        joints: vec![joint; n],
        joint_names: model.joint_names().map(str::to_owned).collect(),
        model: Some(model.clone()),
        ..Setup::default()
    };
    let (free, pushed) = (samples(&model, false), samples(&model, true));
    let configs = configs(n, &setup, &free);
    let stage = |config: &Config| config.stage(setup.clone()).expect("a detector");

    let [mut clock, mut floor, mut apart, mut together] = [(); 4].map(|()| histogram());
    let mut alone: Vec<_> = (configs.iter())
        .map(|_| [histogram(), histogram()])
        .collect();
    let mut data = Data::new(&model);
    let mut out = Slot::default();
    for _ in 0..ROUNDS {
        for sample in &free {
            let sample = warm(sample);
            timed(&mut clock, || {});
            timed(&mut floor, || {
                let (q, qd) = (&sample.position[..n], &sample.velocity[..n]);
                black_box(rnea(&model, &mut data, black_box(q), black_box(qd), qd));
            });
        }
        for (config, [in_free, in_alarm]) in configs.iter().zip(&mut alone) {
            let mut detect = stage(config);
            for sample in &free {
                let sample = warm(sample);
                timed(in_free, || accept(&mut detect, &sample, &mut out));
            }
            let mut detect = stage(config);
            for sample in &pushed {
                let sample = warm(sample);
                let taken_ns = elapsed_ns(|| accept(&mut detect, &sample, &mut out));
                if out.0.alarm() {
                    let _ = in_alarm.record(taken_ns);
                }
            }
        }
        for (shared, histogram) in [(None, &mut apart), (Some(Shared::default()), &mut together)] {
            let setup = Setup {
                shared,
                ..setup.clone()
            };
            let stage = |config: &Config| config.stage(setup.clone()).expect("a detector");
            let mut all: Vec<Detect> = configs.iter().map(stage).collect();
            for sample in &free {
                let sample = warm(sample);
                timed(histogram, || {
                    for detect in &mut all {
                        accept(detect, &sample, &mut out);
                    }
                });
            }
        }
    }

    println!(
        "per sample of {n} joints, {} samples [ns]   p50    p90    p99  p50 / floor  p50 in an alarm",
        clock.len()
    );
    let percentile = |histogram: &Histogram<u64>, q| histogram.value_at_quantile(q);
    let net = |histogram: &Histogram<u64>| {
        percentile(histogram, 0.5).saturating_sub(percentile(&clock, 0.5)) as f64
    };
    let row = |name: &str, histogram: &Histogram<u64>, in_alarm: Option<&Histogram<u64>>| {
        let [p50, p90, p99] = [0.5, 0.9, 0.99].map(|q| percentile(histogram, q));
        let ratio = net(histogram) / net(&floor).max(1.0);
        let in_alarm = in_alarm.map_or(String::new(), |of| percentile(of, 0.5).to_string());
        println!("{name:<38} {p50:>6} {p90:>6} {p99:>6} {ratio:>12.2} {in_alarm:>16}");
    };
    row("the clock itself", &clock, None);
    row("RNEA alone (floor)", &floor, None);
    for (config, [in_free, in_alarm]) in configs.iter().zip(&alone) {
        row(config.name().unwrap_or("?"), in_free, Some(in_alarm));
    }
    row("all, sharing nothing", &apart, None);
    row("all together", &together, None);
}
