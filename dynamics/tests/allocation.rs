//! No algorithm allocates.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use nalgebra::Vector3;
use tauscope_dynamics::derivative::FilteredDerivative;
use tauscope_dynamics::terms::{CoordinateKind, EFFECTS, MotionSample, Site};
use tauscope_dynamics::{
    Data, Inertia, Model, Wrench, forward_dynamics, forward_kinematics, gravity_effort,
    link_jacobian, link_pose, mass_matrix, regressor, rnea,
};

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

fn allocations(work: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="1 2 3"/></joint>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="3"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <link name="lower"><inertial><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial></link></robot>"#;

#[test]
fn nothing_is_allocated_per_call() {
    assert!(
        allocations(|| drop(black_box(vec![1_u8; 100]))) > 0,
        "the counter counts"
    );

    let mut model = Model::from_urdf(ARM).unwrap();
    let mut data = Data::new(&model);
    let tip = model.link_index("lower").unwrap();
    let (q, qd, qdd) = ([0.3, 0.2], [1.0, -0.5], [2.0, 0.1]);
    let push = [Wrench {
        link: tip,
        force_n: Vector3::x(),
        moment_nm: Vector3::y(),
    }];
    let tool = Inertia::new(0.5, [0.0, 0.0, 0.1], [0.001; 6]);
    let mut derivative = FilteredDerivative::new(12.0);
    let mut terms: Vec<_> = EFFECTS
        .iter()
        .map(|effect| {
            let site = Site {
                model: &model,
                joint: 1,
                source: 0,
                link: tip,
            };
            let coordinates = effect.coordinates.iter().map(|c| match c.kind {
                CoordinateKind::Shape { lower, upper, .. } => 0.5 * (lower + upper),
                _ => 0.5,
            });
            (effect.build)(&site, &coordinates.collect::<Vec<_>>())
        })
        .collect();
    let mut effort = [0.0; 2];

    let during = allocations(|| {
        for _ in 0..3 {
            black_box(rnea(&model, &mut data, &q, &qd, &qdd));
            black_box(gravity_effort(&model, &mut data, &q));
            black_box(mass_matrix(&model, &mut data, &q));
            forward_kinematics(&model, &mut data, &q);
            black_box(link_pose(&model, &data, tip));
            black_box(link_jacobian(&model, &mut data, tip));
            black_box(regressor(&model, &mut data, &q, &qd, &qdd));
            black_box(forward_dynamics(&model, &mut data, &q, &qd, &qdd, &push));
            model.set_tool(tip, tool);
            model.attach(tip, tool);
            model.set_gravity([0.0, 1.0, -9.0]);
            black_box(derivative.update(0.001, 0.3));
            let at = MotionSample {
                dt_s: 0.001,
                recording_s: 1.0,
                session_s: 1.0,
                position: &q,
                velocity: &qd,
                acceleration: &qdd,
                transmitted: &q,
            };
            for term in &mut terms {
                term.act(&at, &mut effort);
            }
        }
    });
    assert_eq!(during, 0);
}
