//! Properties common to all stages: one suite for twin, detectors and watch.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tauscope_bus::shell::{self, Context, Ends, Input, Node};
use tauscope_bus::{
    EffortUnit, Emit, JointState, LinkError, Progress, Sample, Source, Stage, StageError,
    TwinState, flags,
};
use tauscope_detect::{Config, DETECTORS, Threshold};
use tauscope_pipeline::build;
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::pipeline::STAGES;
use tauscope_pipeline::report::Problem;

/// The system allocator with a counter per thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

fn count() {
    ALLOCATIONS.with(|allocations| allocations.set(allocations.get() + 1));
}

// SAFETY: every call is forwarded unchanged to the system allocator.
#[allow(
    unsafe_code,
    reason = "a global allocator is unsafe by its nature; test only"
)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const RATE_HZ: i64 = 500;
/// Number of samples after which every filter has settled and every window is full.
const WARM: usize = 2500;
/// Number of samples after which the watch has also learnt its baseline.
const WARM_WATCH: usize = 15_000;

/// Collects the output, up to the reserved capacity.
struct Kept<O>(Vec<O>);

impl<O: Sample> Emit<O> for Kept<O> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut O)) -> Result<(), LinkError> {
        let mut sample = O::default();
        write(&mut sample);
        self.0.push(sample);
        Ok(())
    }
}

/// Constructor of a stage.
type Make<'a, I, O> = &'a dyn Fn() -> Box<dyn Stage<I, O>>;

fn run<I: Sample, O: Sample>(make: Make<'_, I, O>, stream: &[I]) -> Vec<O> {
    let (mut stage, mut out) = (make(), Kept(Vec::new()));
    for sample in stream {
        stage.accept(sample, &mut out).unwrap();
    }
    stage.finish(&mut out).unwrap();
    out.0
}

/// Seven joints that oscillate at different frequencies.
fn motion(count: usize, rate_hz: i64) -> Vec<JointState> {
    let period_ns = 1_000_000_000 / rate_hz;
    let sample = |i: usize| {
        let mut state = JointState::default();
        state.header.stamp_ns = (i as i64 + 1) * period_ns;
        state.header.sequence = i as u64;
        state.header.joint_count = 7;
        state.header.flags = flags::EFFORT_MEASURED;
        let t = state.header.stamp_ns as f64 * 1e-9;
        for j in 0..7 {
            let w = 0.8 + 0.3 * j as f64;
            state.position[j] = 0.4 * (w * t).sin();
            state.velocity[j] = 0.4 * w * (w * t).cos();
            state.effort[j] = 2.0 * (w * t).sin() + 0.1 * (17.0 * w * t).sin();
        }
        state
    };
    (0..count).map(sample).collect()
}

/// Runs the suite. `stream` converts a motion to the input of the stage.
fn keeps_its_promises<I: Sample, O: Sample>(
    name: &str,
    warm: usize,
    make: Make<'_, I, O>,
    stream: &dyn Fn(&[JointState]) -> Vec<I>,
) {
    let usual = motion(2 * warm, RATE_HZ);
    let input = stream(&usual);
    is_deterministic(name, make, &input);
    allocates_nothing(name, warm, make, &input);

    let mut with_gap = usual.clone();
    for state in &mut with_gap[warm..] {
        state.header.stamp_ns += 3_000_000_000;
    }
    ends_ready(name, "a gap of 3 s", make, &stream(&with_gap));

    let mut with_nan = input.clone();
    for sample in &mut with_nan[300..310] {
        poison(sample);
    }
    ends_ready(name, "ten samples of NaN", make, &with_nan);

    ends_ready(name, "100 Hz", make, &stream(&motion(2 * warm, 100)));

    let mut reset = input.clone();
    reset[warm].header_mut().flags |= flags::RESET;
    ends_ready(name, "a reset", make, &reset);
}

fn is_deterministic<I: Sample, O: Sample>(name: &str, make: Make<'_, I, O>, input: &[I]) {
    let (first, second) = (run(make, input), run(make, input));
    assert_eq!(first.len(), input.len(), "{name}: a sample out for each in");
    for (taken, given) in input.iter().zip(&first) {
        let stamps = [taken.header().stamp_ns, given.header().stamp_ns];
        assert_eq!(
            stamps[0], stamps[1],
            "{name}: time is taken from the samples"
        );
    }
    let same = first.iter().zip(&second).all(|(a, b)| bytes(a) == bytes(b));
    assert!(same, "{name}: the same samples give the same bytes");
}

fn bytes<T: Sample>(sample: &T) -> &[u8] {
    bytemuck::bytes_of(sample)
}

fn allocates_nothing<I: Sample, O: Sample>(
    name: &str,
    warm: usize,
    make: Make<'_, I, O>,
    input: &[I],
) {
    let (mut stage, mut out) = (make(), Kept(Vec::with_capacity(input.len())));
    let mut before = 0;
    for (i, sample) in input.iter().enumerate() {
        if i == warm {
            before = ALLOCATIONS.with(std::cell::Cell::get);
        }
        stage.accept(sample, &mut out).unwrap();
    }
    let after = ALLOCATIONS.with(std::cell::Cell::get);
    assert_eq!(
        after,
        before,
        "{name}: allocations in {} samples",
        input.len() - warm
    );
}

/// Checks that the stage is ready at the end of the input and that the stamps of its output increase.
fn ends_ready<I: Sample, O: Sample>(name: &str, what: &str, make: Make<'_, I, O>, input: &[I]) {
    let out = run(make, input);
    let last = out.last().unwrap();
    assert!(
        last.header().has(flags::READY),
        "{name} is not ready at the end of {what}"
    );
    let stamps = out
        .windows(2)
        .all(|pair| pair[0].header().stamp_ns < pair[1].header().stamp_ns);
    assert!(stamps, "{name}: time runs backwards in {what}");
}

/// Sets every number of a sample except its header to NaN.
fn poison<T: Sample>(sample: &mut T) {
    let header = *sample.header();
    for number in bytemuck::cast_slice_mut::<u8, u64>(bytemuck::bytes_of_mut(sample)) {
        *number = f64::NAN.to_bits();
    }
    *sample.header_mut() = header;
}

fn cell() -> Cell {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/demo_arm.urdf");
    let none = BTreeMap::new();
    Cell::from_urdf(&urdf, EffortUnit::Nm, &none, &|_, title| {
        Problem::new(title)
    })
    .unwrap()
}

fn twin(cell: &Cell) -> Box<dyn Stage<JointState, TwinState>> {
    Box::new(build::twin(&tauscope_twin::Config::default(), None, cell).unwrap())
}

#[test]
fn every_stage_is_deterministic_allocates_nothing_and_gets_over_gaps_nan_rates_and_resets() {
    let cell = cell();
    let behind_twin = |states: &[JointState]| run(&|| twin(&cell), states);
    for role in STAGES.iter().map(|kind| kind.key) {
        match role {
            "twin" => keeps_its_promises(role, WARM, &|| twin(&cell), &<[JointState]>::to_vec),
            "detect" => detectors(&cell, &behind_twin),
            "watch" => {
                let config = tauscope_watch::Config::default();
                let make = || -> Box<dyn Stage<_, _>> {
                    Box::new(build::watch(&config, None, 20.0, &cell).unwrap())
                };
                keeps_its_promises(role, WARM_WATCH, &make, &behind_twin);
            }
            // A source, two sinks, and an external program.
            "ingest" | "record" | "publish" | "outside" => {}
            other => panic!("no promises are held to a `{other}` stage"),
        }
    }
}

/// Runs the suite for every detector of the table that works without training; the others are refused at the start.
fn detectors(cell: &Cell, stream: &dyn Fn(&[JointState]) -> Vec<TwinState>) {
    let mut judged = 0;
    for entry in DETECTORS {
        let config = Config {
            threshold: Threshold {
                score: Some(100.0),
                sigmas: None,
            },
            ..Config::default()
        };
        let config = config.with_any((entry.settings)());
        if build::detect(&config, None, cell, None).is_err() {
            continue;
        }
        judged += 1;
        let make = || -> Box<dyn Stage<_, _>> {
            Box::new(build::detect(&config, None, cell, None).unwrap())
        };
        keeps_its_promises(entry.name, WARM, &make, stream);
    }
    assert!(
        judged >= 3,
        "only {judged} detectors run without having learnt"
    );
}

/// Plays a motion and counts the allocations after the warm-up of the stages behind it.
struct Player {
    motion: Vec<JointState>,
    next: usize,
    before: usize,
    allocated: Arc<AtomicUsize>,
}

impl Source<JointState> for Player {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let count = ALLOCATIONS.with(std::cell::Cell::get);
        if self.next == WARM {
            self.before = count;
        }
        let Some(state) = self.motion.get(self.next) else {
            self.allocated.store(count - self.before, Ordering::Relaxed);
            return Ok(Progress::End);
        };
        self.next += 1;
        out.emit(&mut |slot| *slot = *state)?;
        Ok(Progress::More)
    }
}

#[test]
fn from_source_to_alarm_nothing_is_allocated_for_a_sample() {
    let cell = cell();
    let config = Config::default().with_any((DETECTORS[0].settings)());
    let config = Config {
        threshold: Threshold {
            score: Some(100.0),
            sigmas: None,
        },
        ..config
    };
    let allocated = Arc::new(AtomicUsize::new(usize::MAX));
    let samples = 10 * WARM;
    let player = Player {
        motion: motion(samples, RATE_HZ),
        next: 0,
        before: 0,
        allocated: Arc::clone(&allocated),
    };
    let detect = build::detect(&config, None, &cell, None).unwrap();
    let behind = |stage: &str, from: &str| Ends::new(stage, vec![Input::Of(from.to_owned())]);
    let nodes = vec![
        (Node::source(Box::new(player)), Ends::new("play", vec![])),
        (Node::stage(twin(&cell)), behind("twin", "play")),
        (Node::stage(Box::new(detect)), behind("detect", "twin")),
    ];
    let reports = shell::run(&Context::new("play"), nodes).unwrap();
    assert_eq!(reports[2].received, samples as u64);
    // The stages report ten times a second.
    let allocated = allocated.load(Ordering::Relaxed);
    assert!(allocated < samples / 20, "{allocated} in {samples} samples");
}
