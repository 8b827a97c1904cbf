//! Each hypothesis next to an explanation, at the numbers where it is best.
//!
//! A grid is too coarse for a resonance, a gap or a limit. So the shape that scores best on the grid is improved by steps
//! of Gauss and Newton: the derivatives with respect to the shape are further columns, whose coefficients have the width of
//! the grid as their prior (Nocedal and Wright, *Numerical Optimization*, 2006, section 10.3). An effect that is linear
//! in its factors to first order only is linearised again at the factors that it has there: at zero, the tangent of a
//! moved centre of mass lacks the parallel-axis theorem.

use nalgebra::DVector;
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::jacobian::step_of;
use crate::parallel;
use crate::physics::active::Hypothesis;

use super::around::Around;
use super::objective::{Objective, Set};
use super::prior::Magnitude;
use super::refine::bounds;
use super::space::Whitened;
use super::tangents;
use super::variants::{self, Given};

/// Most steps. Resolution: bounds the computing time; each halves what is left or more.
const STEPS: usize = 4;
/// Halvings of a step that does not gain. Resolution: bounds the computing time.
const HALVINGS: usize = 3;
/// Maxima on the grid that are improved. Resolution: changes the computing time.
const MAXIMA: usize = 3;
/// A step that gains less is the last \[nats\]. Resolution: less decides nothing.
const LEAST_GAIN: f64 = 0.2;
/// Prior standard deviation of a time \[s\]. Resolution: of the scan that proposes it.
const TIME_S: f64 = 0.1;

/// Hypotheses at improved shapes: better than those of the objective as an addition to a set, or as a replacement of one of
/// its effects.
pub fn sharpened(
    problem: &Problem,
    fit: &Fit,
    objective: &Objective<'_>,
    set: &Set,
    efforts: &[Magnitude],
) -> Vec<Given> {
    let mut shaped: Vec<Hypothesis> = Vec::new();
    for variant in &objective.variants {
        let hypothesis = variant.hypothesis;
        let is_new = !shaped.contains(&hypothesis);
        let is_exact = hypothesis.is_linear() && !hypothesis.effect.bends();
        if is_new && !is_exact && variant.curve.is_none() {
            shaped.push(hypothesis);
        }
    }
    let Some(around) = Around::new(objective, set) else {
        return Vec::new();
    };
    let whole = objective.score(set);
    let of = |hypothesis: &Hypothesis| {
        let own: Vec<usize> = (0..objective.variants.len())
            .filter(|&v| objective.variants[v].hypothesis == *hypothesis)
            .collect();
        let gains = |removed: Option<usize>| {
            let removed: Vec<usize> = removed.into_iter().collect();
            around.additions(&removed, &own)
        };
        let best = |gains: &[(usize, f64)]| gains.iter().map(|g| g.1).fold(f64::MIN, f64::max);
        let (mut all, mut without) = (gains(None), None);
        let mut most = best(&all);
        for &v in set {
            if own.iter().any(|w| objective.related(v).contains(w)) {
                let less: Set = set.iter().copied().filter(|w| *w != v).collect();
                let others = gains(Some(v));
                let gain = best(&others) + objective.score(&less) - whole;
                if gain > most {
                    (all, without, most) = (others, Some(v), gain);
                }
            }
        }
        let less: Set = set
            .iter()
            .copied()
            .filter(|w| Some(*w) != without)
            .collect();
        let Some(beside) = Around::new(objective, &less) else {
            return Vec::new();
        };
        let search = Search {
            problem,
            fit,
            objective,
            beside,
            efforts,
            hypothesis: *hypothesis,
            count: own.len(),
        };
        let starts = maxima(&all).into_iter();
        let found = starts.filter_map(|v| search.from(&objective.variants[v].shape));
        found.collect::<Vec<Given>>()
    };
    parallel::map(&shaped, of).into_iter().flatten().collect()
}

/// The best variants of a grid of which no neighbour is better: an objective may have several maxima.
fn maxima(gains: &[(usize, f64)]) -> Vec<usize> {
    let gain = |at: Option<usize>| at.and_then(|at| gains.get(at)).map_or(f64::MIN, |g| g.1);
    let is_top = |&at: &usize| {
        let own = gains[at].1;
        own.is_finite() && own > gain(at.checked_sub(1)) && own >= gain(Some(at + 1))
    };
    let mut tops: Vec<usize> = (0..gains.len()).filter(is_top).collect();
    tops.sort_by(|&a, &b| gains[b].1.total_cmp(&gains[a].1));
    tops.truncate(MAXIMA);
    tops.into_iter().map(|at| gains[at].0).collect()
}

/// The search for the shape of one hypothesis.
struct Search<'a> {
    problem: &'a Problem,
    fit: &'a Fit,
    objective: &'a Objective<'a>,
    beside: Around<'a>,
    efforts: &'a [Magnitude],
    hypothesis: Hypothesis,
    /// Shapes on its grid.
    count: usize,
}

impl Search<'_> {
    /// The hypothesis at a better shape than this one, if there is any.
    fn from(&self, shape: &[f64]) -> Option<Given> {
        let mut best = self.at(shape.to_vec())?;
        let first = best.1;
        for _ in 0..STEPS {
            let Some(step) = self.step(&best.0).filter(|step| !step.is_empty()) else {
                break;
            };
            let before = best.1;
            let mut share = 1.0;
            for _ in 0..HALVINGS {
                let moved = self.moved(&best.0.variant.shape, &step, share);
                match self.at(moved) {
                    Some(other) if other.1 > best.1 => {
                        best = other;
                        break;
                    }
                    _ => share *= 0.5,
                }
            }
            if best.1 < before + LEAST_GAIN {
                break;
            }
        }
        // An effect without any gain at its tangent is left there: to linearise it takes long.
        for _ in 0..STEPS {
            if !self.hypothesis.effect.bends() || best.1 <= 0.0 {
                break;
            }
            let before = best.1;
            let Some(other) = self.linearised(&best.0).filter(|other| other.1 > before) else {
                break;
            };
            best = other;
            if best.1 < before + LEAST_GAIN {
                break;
            }
        }
        (best.1 > first + LEAST_GAIN).then_some(best.0)
    }

    /// The hypothesis as its tangent at the factors that it has here, and its gain.
    fn linearised(&self, given: &Given) -> Option<(Given, f64)> {
        let factors = self.factors(given, &self.objective.whitened(given))?;
        let active = given.variant.with(&factors);
        let tangent = tangents::tangent(self.problem, self.fit, &active, self.count, self.efforts);
        let gain = self.gain(&tangent);
        Some((tangent, gain))
    }

    /// The gain by a hypothesis \[nats\].
    fn gain(&self, given: &Given) -> f64 {
        let whitened = self.objective.whitened(given);
        let (own, right) = self.beside.products(&whitened);
        let gram = self.objective.products(&whitened);
        self.objective.gain(&given.variant, &gram, &own, &right)
    }

    /// The hypothesis at a shape, and its gain.
    fn at(&self, shape: Vec<f64>) -> Option<(Given, f64)> {
        let given = variants::at(
            self.problem,
            self.fit,
            self.hypothesis,
            shape,
            self.count,
            self.efforts,
        )?;
        let gain = self.gain(&given);
        Some((given, gain))
    }

    /// The shape's coordinates: index and prior standard deviation.
    fn coordinates(&self, shape: &[f64]) -> Vec<(usize, f64)> {
        let all = self.hypothesis.effect.coordinates.iter().enumerate();
        let of = |(c, coordinate): (usize, &tauscope_dynamics::terms::Coordinate)| {
            let width = match coordinate.kind {
                CoordinateKind::Factor { .. } => return None,
                CoordinateKind::RecordingTime | CoordinateKind::SessionTime => TIME_S,
                CoordinateKind::Shape {
                    lower,
                    upper,
                    steps,
                    scale,
                } => {
                    let steps = (steps - 1).max(1) as f64;
                    match scale {
                        Scale::Linear | Scale::Waves => (upper - lower) / steps,
                        Scale::Log => shape[c] * (upper / lower).ln() / steps,
                        Scale::OfEffort => {
                            let largest = self.problem.largest_effort[self.hypothesis.place.joint];
                            largest * (upper - lower) / steps
                        }
                    }
                }
            };
            Some((c, width))
        };
        all.filter_map(of).collect()
    }

    /// The most probable factors of a hypothesis with these columns, one by one at their bounds.
    fn factors(&self, given: &Given, whitened: &[Whitened]) -> Option<Vec<f64>> {
        let variant = &given.variant;
        let solved = self.solved(whitened, given.alone.is_some())?;
        let numbers = solved
            .iter()
            .zip(&variant.deviations)
            .zip(&variant.positive);
        let factor = |((mean, deviation), positive): ((&f64, &f64), &bool)| {
            let value = mean * deviation;
            if *positive { value.max(0.0) } else { value }
        };
        Some(numbers.map(factor).collect())
    }

    /// The step of Gauss and Newton: changes of the shape's coordinates.
    fn step(&self, given: &Given) -> Option<Vec<(usize, f64)>> {
        let (problem, variant) = (self.problem, &given.variant);
        let coordinates = self.coordinates(&variant.shape);
        let whitened = self.objective.whitened(given);
        let factors = self.factors(given, &whitened)?;
        let here = effort(given, &factors);
        let active = variant.with(&factors);
        let derivative = |&(c, width): &(usize, f64)| {
            let (_, upper) = bounds(problem, &active, c);
            let step = step_of(problem, &active, c);
            let step = if variant.shape[c] + step > upper {
                -step
            } else {
                step
            };
            let mut there = variant.shape.clone();
            there[c] += step;
            let columns = self.fit.columns(problem, self.hypothesis, &there);
            let mut there = columns.alone.clone();
            for (column, factor) in columns.factors.iter().zip(&factors) {
                there = Some(sum(there, column.times(*factor)));
            }
            let there = there?;
            let values = there.values.iter().zip(&here.values);
            let values = values.map(|(there, here)| (there - here) / step * width);
            let column = Column {
                joint: there.joint,
                values: values.collect(),
            };
            (column.joint == here.joint).then_some(column)
        };
        let derivatives: Option<Vec<Column>> = coordinates.iter().map(derivative).collect();
        let derivatives = derivatives?;
        let unscaled: Vec<(&Column, f64)> =
            derivatives.iter().map(|column| (column, 1.0)).collect();
        let mut all = whitened;
        all.extend(
            self.objective
                .space
                .columns(&unscaled, &self.objective.measured),
        );
        let solved = self.solved(&all, given.alone.is_some())?;
        let steps = coordinates.iter().zip(solved.iter().skip(factors.len()));
        Some(steps.map(|(&(c, width), x)| (c, x * width)).collect())
    }

    /// The most probable coefficients of columns, in prior standard deviations. With `offset`, the first column is one
    /// whose coefficient is one.
    fn solved(&self, columns: &[Whitened], offset: bool) -> Option<DVector<f64>> {
        let (own, mut right) = self.beside.products(columns);
        if offset {
            right -= own.column(0);
        }
        let first = usize::from(offset);
        let m = own.nrows() - first;
        let mut normal = own.view((first, first), (m, m)).into_owned();
        for i in 0..m {
            normal[(i, i)] += 1.0;
        }
        let right = right.rows(first, m).into_owned();
        Some(normal.cholesky()?.solve(&right))
    }

    /// A shape after a share of a step, within its bounds.
    fn moved(&self, shape: &[f64], step: &[(usize, f64)], share: f64) -> Vec<f64> {
        let active = self.hypothesis.with(shape.to_vec());
        let mut moved = shape.to_vec();
        for &(c, change) in step {
            let (lower, upper) = bounds(self.problem, &active, c);
            moved[c] = (moved[c] + share * change).clamp(lower, upper);
        }
        moved
    }
}

/// Effort of a hypothesis with these factors.
fn effort(given: &Given, factors: &[f64]) -> Column {
    let parts = given.factors.iter().zip(factors);
    let parts = parts.map(|(column, factor)| column.times(*factor));
    let alone = given.alone.iter().cloned();
    let all = alone
        .chain(parts)
        .fold(None, |total, part| Some(sum(total, part)));
    all.unwrap_or(Column {
        joint: None,
        values: Vec::new(),
    })
}

fn sum(total: Option<Column>, part: Column) -> Column {
    match total {
        Some(mut total) if total.joint == part.joint => {
            for (total, part) in total.values.iter_mut().zip(&part.values) {
                *total += part;
            }
            total
        }
        _ => part,
    }
}

#[cfg(test)]
mod tests {
    use super::maxima;

    #[test]
    fn the_best_maxima_of_a_grid_come_first() {
        let gains = [1.0, 5.0, 2.0, 2.0, 9.0, f64::NEG_INFINITY, 3.0];
        let gains: Vec<(usize, f64)> = (10..).zip(gains).collect();
        assert_eq!(maxima(&gains), [14, 11, 16]);
    }
}
