//! Nanoseconds per call of the algorithms on one robot: `cargo bench -p tauscope-dynamics --bench per_call -- URDF`.
//!
//! A line each: algorithm, nanoseconds per sample (the fastest of twenty rounds, so that what else runs counts little),
//! and a sum of what it answered, by which another library can be held against it. `batch_` stands before an algorithm
//! that takes four samples at once. The states are those of
//! `benches/pinocchio/per_call.cpp`.

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use tauscope_dynamics::{
    Data, Lanes, Model, Real, forward_kinematics, link_jacobian, mass_matrix, regressor, rnea,
};

/// States that are gone through.
const STATES: usize = 256;
/// Times that all states are gone through in a round.
const PASSES: usize = 40;
const ROUNDS: usize = 20;

/// A state of one sample, or of as many as `T` has lanes.
struct State<T> {
    q: Vec<T>,
    qd: Vec<T>,
    qdd: Vec<T>,
}

fn states(dof: usize) -> Vec<State<f64>> {
    let of = |f: fn(f64, f64) -> f64, k: usize| (0..dof).map(|j| f(k as f64, j as f64)).collect();
    let state = |k| State {
        q: of(|k, j| (0.7 * k + 1.3 * j).sin(), k),
        qd: of(|k, j| (0.9 * k + 0.4 * j).cos(), k),
        qdd: of(|k, j| (1.1 * k - 0.6 * j).sin(), k),
    };
    (0..STATES).map(state).collect()
}

/// Batches of four states.
fn batches(states: &[State<f64>]) -> Vec<State<Lanes>> {
    let of = |four: &[State<f64>; 4], field: fn(&State<f64>) -> &[f64]| {
        let joint = |j: usize| Lanes::from([0, 1, 2, 3].map(|lane| field(&four[lane])[j]));
        (0..field(&four[0]).len()).map(joint).collect()
    };
    let (fours, _) = states.as_chunks::<4>();
    let batch = |four: &[State<f64>; 4]| State {
        q: of(four, |s| &s.q),
        qd: of(four, |s| &s.qd),
        qdd: of(four, |s| &s.qdd),
    };
    fours.iter().map(batch).collect()
}

fn measure<T>(algorithm: &str, states: &[State<T>], mut call: impl FnMut(&State<T>)) {
    let round = |_| {
        let begin = Instant::now();
        for _ in 0..PASSES {
            for state in states {
                call(black_box(state));
            }
        }
        begin.elapsed().as_secs_f64() * 1e9 / (PASSES * STATES) as f64
    };
    let fastest = (0..ROUNDS).map(round).fold(f64::INFINITY, f64::min);
    print!("{algorithm} {fastest:.2} ");
}

fn squares<T: Real>(values: &[T]) -> f64 {
    let square = |value: &T| *value * *value;
    values
        .iter()
        .map(|value| square(value).simd_horizontal_sum())
        .sum()
}

fn algorithms<T: Real>(prefix: &str, model: &Model, states: &[State<T>]) {
    let mut data = Data::<T>::new(model);
    let tip = model.links().len() - 1;

    measure(&format!("{prefix}rnea"), states, |s| {
        black_box(rnea(model, &mut data, &s.q, &s.qd, &s.qdd));
    });
    let sum: f64 = (states.iter())
        .map(|s| squares(rnea(model, &mut data, &s.q, &s.qd, &s.qdd)))
        .sum();
    println!("{sum:.9e}");

    measure(&format!("{prefix}regressor"), states, |s| {
        black_box(regressor(model, &mut data, &s.q, &s.qd, &s.qdd));
    });
    let sum: f64 = (states.iter())
        .map(|s| squares(regressor(model, &mut data, &s.q, &s.qd, &s.qdd).as_slice()))
        .sum();
    println!("{sum:.9e}");

    measure(&format!("{prefix}jacobian"), states, |s| {
        forward_kinematics(model, &mut data, &s.q);
        black_box(link_jacobian(model, &mut data, tip));
    });
    let sum: f64 = (states.iter())
        .map(|s| {
            forward_kinematics(model, &mut data, &s.q);
            squares(link_jacobian(model, &mut data, tip).as_slice())
        })
        .sum();
    println!("{sum:.9e}");

    measure(&format!("{prefix}mass_matrix"), states, |s| {
        black_box(mass_matrix(model, &mut data, &s.q));
    });
    let sum: f64 = (states.iter())
        .map(|s| squares(mass_matrix(model, &mut data, &s.q).as_slice()))
        .sum();
    println!("{sum:.9e}");
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().skip(1).find(|it| !it.starts_with("--"));
    let Some(path) = path else {
        println!("SKIPPED: no robot was named: cargo bench --bench per_call -- URDF");
        return Ok(());
    };
    let model = Model::from_urdf(&std::fs::read_to_string(path)?)?;
    let states = states(model.dof());
    algorithms("", &model, &states);
    algorithms("batch_", &model, &batches(&states));
    Ok(())
}
