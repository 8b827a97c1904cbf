//! Location of the mismatch without a hypothesis: by joint, by state, by time.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::report::schema::Located;

/// Number of parts with equally many rows in position, speed, acceleration or load, and of parts of equal length in a
/// recording.
/// Resolution: that of words such as slow and fast.
const PARTS: i32 = 5;
/// Number of listed states of a joint.
/// Resolution: the page shows the first few.
const MOST_STATES: usize = 3;

/// Whether the mean of `count` squares exceeds `usual` significantly: by three standard deviations of the mean of a
/// normal variable's squares.
fn stands_out(mean: f64, usual: f64, count: usize) -> bool {
    let spread = (2.0 / count.max(1) as f64).sqrt();
    mean > usual * (1.0 + 3.0 * spread)
}

/// Returns the mismatch of each joint over all states, followed by the states in which it is concentrated; the
/// largest first.
pub fn located(problem: &Problem, before: &Fit, joints: &[String]) -> Vec<Located> {
    let mut all = Vec::new();
    for (j, name) in joints.iter().enumerate() {
        let rows = rows_of(problem, before, j);
        let total: f64 = rows.iter().map(|s| s.square).sum();
        let mean = total / rows.len().max(1) as f64;
        let noise = problem.white_noise[j].max(1e-12);
        let over_noise = mean.sqrt() / noise;
        if !stands_out(mean, noise * noise, rows.len()) {
            continue;
        }
        let whole = Located {
            joint: name.clone(),
            place: "all of the motion".to_owned(),
            share_of_residual: 1.0,
            over_noise,
        };
        all.push((over_noise, whole, concentrated(problem, &rows, name, noise)));
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.into_iter()
        .flat_map(|(_, joint, states)| std::iter::once(joint).chain(states))
        .collect()
}

/// Returns the compared rows of a joint.
fn rows_of(problem: &Problem, before: &Fit, joint: usize) -> Vec<Row> {
    let rows = problem.joint_rows(joint);
    let mut all = Vec::new();
    for (r, track) in problem.tracks.iter().enumerate() {
        for (row, &k) in track.rows().zip(&track.compared) {
            if problem.weight[rows.start + row] > 0.0 {
                let at = k * problem.joints + joint;
                all.push(Row {
                    square: before.residual[rows.start + row].powi(2),
                    position: track.track.position[at],
                    velocity: track.track.velocity[at],
                    acceleration: track.track.acceleration[at],
                    load: track.track.rigid[at],
                    recording: r,
                    time_s: track.track.time_s[k],
                });
            }
        }
    }
    all
}

/// Returns the states of a joint in which its mismatch is concentrated: the [`MOST_STATES`] with the largest RMS.
fn concentrated(problem: &Problem, rows: &[Row], name: &str, noise: f64) -> Vec<Located> {
    let total: f64 = rows.iter().map(|s| s.square).sum();
    let mean = total / rows.len().max(1) as f64;
    let mut states: Vec<Located> = Vec::new();
    let mut state = |place: String, of: &dyn Fn(&Row) -> bool| {
        let squares: Vec<f64> = rows.iter().filter(|s| of(s)).map(|s| s.square).collect();
        let sum: f64 = squares.iter().sum();
        let square = sum / squares.len().max(1) as f64;
        if stands_out(square, mean, squares.len()) {
            states.push(Located {
                joint: name.to_owned(),
                place,
                share_of_residual: sum / total,
                over_noise: square.sqrt() / noise,
            });
        }
    };
    let share = |part: i32| f64::from(part) / f64::from(PARTS);
    let (first, last) = (share(1), share(PARTS - 1));
    let slow = quantile(rows, |s| s.velocity.abs(), first);
    let fast = quantile(rows, |s| s.velocity.abs(), last);
    state(
        format!("slow and around reversals, |qd| < {slow:.3} rad/s"),
        &|s| s.velocity.abs() < slow,
    );
    state(format!("fast, |qd| > {fast:.2} rad/s"), &|s| {
        s.velocity.abs() > fast
    });
    state("moving forward".to_owned(), &|s| s.velocity > 0.0);
    state("moving backward".to_owned(), &|s| s.velocity < 0.0);
    let hard = quantile(rows, |s| s.acceleration.abs(), last);
    state(
        format!("accelerating hard, |qdd| > {hard:.2} rad/s²"),
        &|s| s.acceleration.abs() > hard,
    );
    let loaded = quantile(rows, |s| s.load.abs(), last);
    state(
        format!("under high load, |effort| > {loaded:.1} N m"),
        &|s| s.load.abs() > loaded,
    );
    for part in 0..PARTS {
        let low = quantile(rows, |s| s.position, share(part));
        let high = quantile(rows, |s| s.position, share(part + 1));
        state(format!("position {low:.2} to {high:.2} rad"), &|s| {
            s.position >= low && s.position < high
        });
    }
    for (r, track) in problem.tracks.iter().enumerate() {
        let recording = &track.track.name;
        state(format!("recording {recording}"), &|s| s.recording == r);
        let end = track.track.time_s.last().copied().unwrap_or(0.0);
        for part in 0..PARTS {
            let (from, to) = (end * share(part), end * share(part + 1));
            state(
                format!("recording {recording}, {from:.1} to {to:.1} s"),
                &|s| s.recording == r && s.time_s >= from && s.time_s < to,
            );
        }
    }
    states.sort_by(|a, b| b.over_noise.total_cmp(&a.over_noise));
    states.truncate(MOST_STATES);
    states
}

struct Row {
    square: f64,
    position: f64,
    velocity: f64,
    acceleration: f64,
    load: f64,
    recording: usize,
    time_s: f64,
}

fn quantile(rows: &[Row], of: impl Fn(&Row) -> f64, share: f64) -> f64 {
    let mut values: Vec<f64> = rows.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values
        .get((share * last as f64).round() as usize)
        .copied()
        .unwrap_or(0.0)
}
