//! Test of the residual: whether a feature of the motion predicts it in a recording that was left out of the fit.
//!
//! Each recording is left out in turn, and its whitened residual compared with features of the joint's motion by ridge
//! regressions that leave it out, too. The same is done with residuals that are turned in time, rolled, and given a random
//! sign by recording: the largest score of all joints and features among those is what chance reaches, so one comparison
//! covers all of them (maximum statistic; Westfall and Young, *Resampling-Based Multiple Testing*, 1993).

use nalgebra::{DMatrix, DVector};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

use super::laws;
use super::nuisance;
use super::space::Space;

/// Number of surrogates. Statistical: what exceeds all of them has a probability of at most one in sixty.
const SURROGATES: usize = 59;
/// Smallest share of a joint's squared residual that is worth a sentence. Chosen: less does not change what a reader does.
const LEAST_SHARE: f64 = 0.05;
/// Ridge of the regressions on features that have unit variance \[rows\]. Chosen: as many rows as knots.
const RIDGE: f64 = 20.0;

/// A feature of a joint's motion with the columns that span its functions.
pub struct Feature {
    /// Its name in reports.
    pub name: &'static str,
    /// The joint.
    pub joint: usize,
    /// Its columns, as signals of the joint.
    pub columns: Vec<Vec<f64>>,
}

/// The features of all joints: curves of the motion, and the acceleration.
pub fn features(problem: &Problem, fit: &Fit) -> Vec<Feature> {
    let of_joint = |joint: usize| {
        let accelerations =
            |r: usize, k: usize| problem.tracks[r].track.acceleration[k * problem.joints + joint];
        let acceleration = laws::column_of(problem, joint, accelerations);
        let curves = laws::curves(problem, fit, joint).into_iter();
        let curves = curves.map(|curve| (curve.of, curve.columns));
        let late = nuisance::late(problem, fit, joint);
        let later = column_in_session(problem, &late);
        let all = curves.chain([
            ("acceleration", vec![acceleration]),
            ("change in time, as if it were late", vec![late]),
            ("change in time, as if it were later and later", vec![later]),
        ]);
        let feature = move |(name, columns): (&'static str, Vec<Column>)| Feature {
            name,
            joint,
            columns: columns.into_iter().map(|column| column.values).collect(),
        };
        all.map(feature).collect::<Vec<_>>()
    };
    (0..problem.joints).flat_map(of_joint).collect()
}

/// A joint's column times the time of the session.
fn column_in_session(problem: &Problem, column: &Column) -> Column {
    let mut values = column.values.clone();
    for track in &problem.tracks {
        for (row, &k) in track.rows().zip(&track.compared) {
            values[row] *= track.track.session_s + track.track.time_s[k];
        }
    }
    Column {
        joint: column.joint,
        values,
    }
}

/// A feature that predicts the residual.
#[derive(Debug, Clone)]
pub struct Predicted {
    /// The joint.
    pub joint: usize,
    /// The feature, in words.
    pub by: &'static str,
    /// Share of the joint's squared residual that it predicts in recordings that were left out.
    pub share: f64,
}

/// Products of one joint's residual and a feature's columns, by recording.
struct Compared {
    joint: usize,
    by: &'static str,
    columns: Vec<DMatrix<f64>>,
    normal: Vec<DMatrix<f64>>,
}

/// The features that predict the residual better than chance, the strongest of each joint. `residuals` are whitened,
/// by joint and recording, each of a fit without that recording.
pub fn predicted(
    space: &Space,
    residuals: &[Vec<DVector<f64>>],
    features: &[Feature],
) -> Vec<Predicted> {
    let pieces = residuals.first().map_or(0, Vec::len);
    if pieces < 2 {
        return Vec::new();
    }
    let compared: Vec<Compared> = features
        .iter()
        .map(|feature| Compared::of(space, feature, pieces))
        .collect();
    let squares: Vec<f64> = residuals
        .iter()
        .map(|of_joint| {
            of_joint
                .iter()
                .map(DVector::norm_squared)
                .sum::<f64>()
                .max(1e-12)
        })
        .collect();
    let score = |compared: &Compared, residual: &[DVector<f64>]| compared.gain(residual);
    let own: Vec<f64> = compared
        .iter()
        .map(|c| score(c, &residuals[c.joint]))
        .collect();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut all = vec![Vec::with_capacity(SURROGATES); compared.len()];
    for _ in 0..SURROGATES {
        let turned: Vec<Vec<DVector<f64>>> = residuals
            .iter()
            .map(|of_joint| of_joint.iter().map(|e| surrogate(e, &mut random)).collect())
            .collect();
        for (scores, c) in all.iter_mut().zip(&compared) {
            scores.push(score(c, &turned[c.joint]));
        }
    }
    // Scores in units of what chance makes of each feature, so that they can be compared.
    let standard = |scores: &[f64], x: f64| {
        let mean = scores.iter().sum::<f64>() / scores.len() as f64;
        let variance = scores.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / scores.len() as f64;
        (x - mean) / (variance.sqrt() + 1e-9)
    };
    let chance = (0..SURROGATES)
        .flat_map(|s| all.iter().map(move |scores| standard(scores, scores[s])))
        .fold(0.0, f64::max);
    let mut found: Vec<(f64, Predicted)> = Vec::new();
    for ((c, gain), scores) in compared.iter().zip(&own).zip(&all) {
        let share = gain / squares[c.joint];
        let z = standard(scores, *gain);
        if z > chance && share > LEAST_SHARE {
            found.push((
                share,
                Predicted {
                    joint: c.joint,
                    by: c.by,
                    share,
                },
            ));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut strongest: Vec<Predicted> = Vec::new();
    for (_, predicted) in found {
        if strongest.iter().all(|other| other.joint != predicted.joint) {
            strongest.push(predicted);
        }
    }
    strongest
}

impl Compared {
    fn of(space: &Space, feature: &Feature, pieces: usize) -> Self {
        let mut whitened: Vec<Vec<Vec<f64>>> = feature
            .columns
            .iter()
            .map(|column| space.whitened_by_piece(feature.joint, column, pieces))
            .collect();
        for column in &mut whitened {
            let rows: usize = column.iter().map(Vec::len).sum();
            let square: f64 = column.iter().flatten().map(|x| x * x).sum();
            let scale = (rows as f64 / square.max(1e-12)).sqrt();
            column.iter_mut().flatten().for_each(|x| *x *= scale);
        }
        let columns: Vec<DMatrix<f64>> = (0..pieces)
            .map(|r| {
                let rows = whitened.first().map_or(0, |column| column[r].len());
                DMatrix::from_fn(rows, whitened.len(), |k, c| whitened[c][r][k])
            })
            .collect();
        let normal = columns.iter().map(|x| x.tr_mul(x)).collect();
        Self {
            joint: feature.joint,
            by: feature.name,
            columns,
            normal,
        }
    }

    /// Squares that the feature predicts in recordings that are left out.
    fn gain(&self, residual: &[DVector<f64>]) -> f64 {
        let right: Vec<DVector<f64>> = self
            .columns
            .iter()
            .zip(residual)
            .map(|(x, e)| x.tr_mul(e))
            .collect();
        let count = self.columns[0].ncols();
        let whole = self
            .normal
            .iter()
            .fold(DMatrix::zeros(count, count), |sum, n| sum + n);
        let all = right.iter().fold(DVector::zeros(count), |sum, b| sum + b);
        let of = |r: usize| {
            let mut normal = &whole - &self.normal[r];
            for i in 0..count {
                normal[(i, i)] += RIDGE;
            }
            let others = &all - &right[r];
            normal.cholesky().map_or(0.0, |factor| {
                let x = factor.solve(&others);
                2.0 * x.dot(&right[r]) - x.dot(&(&self.normal[r] * &x))
            })
        };
        (0..self.columns.len()).map(of).sum()
    }
}

/// A residual turned in time, rolled, and with a random sign.
fn surrogate(residual: &DVector<f64>, random: &mut Random) -> DVector<f64> {
    let count = residual.len();
    if count < 8 {
        return residual.clone();
    }
    let shift = count / 8 + random.below(count - count / 8);
    let turned = random.below(2) == 1;
    let sign = if random.below(2) == 1 { 1.0 } else { -1.0 };
    DVector::from_fn(count, |k, _| {
        let at = (k + shift) % count;
        sign * residual[if turned { count - 1 - at } else { at }]
    })
}

/// A small generator of random numbers (Marsaglia, "Xorshift RNGs", 2003): a report is the same each time.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % bound.max(1)
    }
}
