//! The light detectors allocate nothing per sample.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tauscope_bus::{Detection, Emit, Header, LinkError, Stage, TwinState, flags};
use tauscope_detect::indri::{virtual_collision_sensor, virtual_collision_sensor_basic};
use tauscope_detect::salt_ducaju::{contact_classifier, frequency_classifier};
use tauscope_detect::tajiri::{momentum_observer, naive_difference, twin_regression};
use tauscope_detect::{Config, JointSetup, Lesson, Lessons, Setup, Threshold, tauscope};
use tauscope_dynamics::Model;

/// The system's allocator, counting per thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    ALLOCATIONS.with(|allocations| allocations.set(allocations.get() + 1));
}

// SAFETY: every call is passed on to the system's allocator as it came.
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

/// By now every window is full and the band's bins are known.
const WARM: i32 = 700;

struct Nowhere;

impl Emit<Detection> for Nowhere {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        write(&mut Detection::default());
        Ok(())
    }
}

#[test]
fn nothing_is_allocated_per_sample() {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    let arm = include_str!("../../../tests/data/demo_arm.urdf");
    let model = Model::from_urdf(arm).unwrap();
    let setup = Setup {
        joints: vec![joint; 7],
        joint_names: model.joint_names().map(str::to_owned).collect(),
        model: Some(model),
        ..Setup::default()
    };
    let bias = vec![0.5; 7];
    let bias = Some(virtual_collision_sensor::FirstBias::InOrder(bias));
    let scored = Config {
        threshold: Threshold {
            score: Some(100.0),
            sigmas: None,
        },
        ..Config::default()
    };
    let configs = [
        scored.clone().with(twin_regression::Settings::default()),
        scored.clone().with(naive_difference::Settings::default()),
        scored.with(momentum_observer::Settings::default()),
        Config::of(contact_classifier::Settings::default()),
        Config::of(frequency_classifier::Settings::default()),
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
        Config::of(learnt(&setup)),
    ];
    for config in configs {
        let mut detect = config.stage(setup.clone()).unwrap();
        let mut before = 0;
        for i in 0..2000_i32 {
            if i == WARM {
                before = ALLOCATIONS.with(Cell::get);
            }
            // Now and then a collision.
            detect
                .accept(&sample(i, i % 700 > 600), &mut Nowhere)
                .unwrap();
        }
        assert_eq!(ALLOCATIONS.with(Cell::get), before, "{config:?}");
    }
}

fn sample(i: i32, pushed: bool) -> TwinState {
    let mut sample = TwinState {
        header: Header {
            stamp_ns: i64::from(i) * 2_000_000,
            flags: flags::READY,
            joint_count: 7,
            ..Header::default()
        },
        ..TwinState::default()
    };
    for j in 0..7 {
        let t = f64::from(i) * 0.002;
        sample.expected_effort[j] = (3.0 * t).sin();
        sample.effort[j] = (3.1 * t).sin() + if pushed { 5.0 } else { 0.0 };
    }
    sample
}

/// `tauscope` as contact-free samples have taught it.
fn learnt(setup: &Setup) -> tauscope::Settings {
    let free = [Lesson {
        name: "free".to_owned(),
        samples: (0..20_000).map(|i| sample(i, false)).collect(),
        contacts: Some(Vec::new()),
    }];
    let lessons = Lessons {
        train: &free,
        validation: &[],
    };
    tauscope::learn(&tauscope::Settings::default(), setup, &lessons).unwrap()
}
