//! Curves over a short piece of a joint's way, where most of the residual lies: a dent in a race, a broken tooth. Knots spread
//! over the whole way are too far apart for it, and it then looks like several short pushes.

use tauscope_dynamics::terms::{Against, Table};

use crate::data::problem::Problem;

/// Distances of knots that are tried, as shares of the joint's way.
/// Resolution: knots over the whole way (`curve_axes`) are 1/27 apart; what is shorter than 1/80 passes within the
/// comparison's fastest response.
const SPACINGS: [f64; 2] = [1.0 / 80.0, 1.0 / 40.0];
/// Knots, the middle one where most of the residual lies.
/// Resolution: a bump, or a pull one way and then the other, that has ended at the outer ones.
const KNOTS: usize = 7;
/// In the piece between them the squared residual is at least this many times as large as on average.
/// Tuned: by hand, with `tests/proof/first_sight.py --seed 41` in view; not swept.
const DENSER: f64 = 3.0;
/// Recordings that must pass the piece: only another one shows that it is the place that counts.
/// Statistical: two is the least that can repeat.
const LEAST_RECORDINGS: usize = 2;

/// A row of the joint: where it is, how much is left there, and in which recording.
struct Row {
    position: f64,
    square: f64,
    recording: usize,
}

/// Curves over the pieces of the way in which most of `residual` lies, if it lies anywhere.
pub fn spots(problem: &Problem, residual: &[f64], joint: usize) -> Vec<Table> {
    let rows = rows(problem, residual, joint);
    let least = rows
        .iter()
        .map(|row| row.position)
        .fold(f64::INFINITY, f64::min);
    let most = rows
        .iter()
        .map(|row| row.position)
        .fold(f64::NEG_INFINITY, f64::max);
    if least >= most || !(most - least).is_finite() {
        return Vec::new();
    }
    let spacings = SPACINGS.iter().map(|share| share * (most - least));
    let middles = spacings.filter_map(|spacing| Some((spacing, middle(&rows, least, spacing)?)));
    let of = |(spacing, middle): (f64, f64)| {
        let knot = |k: usize| middle + spacing * (k as f64 - (KNOTS / 2) as f64);
        let knots: Vec<f64> = (0..KNOTS).map(knot).collect();
        [false, true].map(|by_direction| Table {
            against: Against::Position,
            of_joint: joint,
            by_direction,
            period: None,
            values: vec![0.0; KNOTS],
            knots: knots.clone(),
        })
    };
    middles.flat_map(of).collect()
}

fn rows(problem: &Problem, residual: &[f64], joint: usize) -> Vec<Row> {
    let first = problem.joint_rows(joint).start;
    let row = |(recording, row, k): (usize, usize, usize)| Row {
        position: problem.tracks[recording].track.position[k * problem.joints + joint],
        square: residual[first + row] * residual[first + row],
        recording,
    };
    problem.counted(joint).map(row).collect()
}

/// The middle of the piece with the largest sum of squares, if it is dense enough there.
fn middle(rows: &[Row], least: f64, spacing: f64) -> Option<f64> {
    let bin = |row: &Row| ((row.position - least) / spacing) as usize;
    let bins = 1 + rows.iter().map(bin).max()?;
    let (mut squares, mut counts) = (vec![0.0; bins], vec![0.0; bins]);
    for row in rows {
        squares[bin(row)] += row.square;
        counts[bin(row)] += 1.0;
    }
    let width = KNOTS - 1;
    let sum = |all: &[f64], from: usize| all[from..from + width].iter().sum::<f64>();
    let starts = 0..(bins + 1).checked_sub(width)?;
    let start = starts.max_by(|a, b| sum(&squares, *a).total_cmp(&sum(&squares, *b)))?;
    let share = |all: &[f64]| sum(all, start) / all.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let inside = rows
        .iter()
        .filter(|row| (start..start + width).contains(&bin(row)));
    let mut recordings: Vec<usize> = inside.map(|row| row.recording).collect();
    recordings.dedup();
    let is_spot = share(&squares) > DENSER * share(&counts) && recordings.len() >= LEAST_RECORDINGS;
    is_spot.then(|| least + spacing * (start as f64 + width as f64 / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::problem_with;
    use crate::select::propose::Base;

    const DENT_RAD: f64 = 0.2;

    #[test]
    fn a_dent_is_drawn_where_it_is_and_what_lies_everywhere_has_no_spot() {
        let dent = |q: f64| {
            let x = (q - DENT_RAD) / 0.03;
            6.0 * x * (-0.5 * x * x).exp()
        };
        let problem = problem_with(4, |q, _, effort| effort[0] += dent(q[0]));
        let nothing = Fit::new(&problem, Vec::new());
        let curve = Base::new(&problem, &nothing, 40).propose_curve(0).unwrap();
        let drawn = curve.active.curve.as_ref().unwrap();
        assert_eq!(drawn.against, Against::Position);
        let [first, last] = [drawn.knots[0], drawn.knots[drawn.knots.len() - 1]];
        assert!(
            first < DENT_RAD && DENT_RAD < last && last - first < 0.5,
            "{first} to {last}"
        );
        let everywhere = problem_with(4, |_, qd, effort| effort[0] += 2.0 * qd[0]);
        let nothing = Fit::new(&everywhere, Vec::new());
        assert!(spots(&everywhere, &nothing.residual, 0).is_empty());
    }
}
