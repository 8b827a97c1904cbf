//! A step of least squares that keeps every body physically consistent.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::{Inertia, Model};

use crate::fit::body_prior::{Body, about, bodies, density_of, of_body};
use crate::fit::least_squares::solved;
use crate::physics::active::{Active, BODY};

/// The prior's weight is multiplied by this from one round to the next, until it is 1.
/// Resolution: rounds against steps within a round.
const ROUND: f64 = 0.1;
/// Most steps within a round.
/// Resolution: bounds the computing time of a round that does not converge.
const MOST_STEPS: usize = 20;
/// A round ends when its next step promises less than this, times the prior's weight \[nats\].
/// Resolution: far below any difference that evidence is decided by.
const CONVERGED: f64 = 1e-6;
/// How often a step is halved at most.
/// Resolution: 2⁻³⁰ of a step changes nothing.
const MOST_HALVINGS: usize = 30;
/// Added to the diagonal, as a share of it, to find the weight of the first round.
/// Resolution: the weight only decides how many rounds there are.
const RIDGE: f64 = 1e-9;

/// The step from normal equations with the prior of bodies, for the coordinates in `used`, the others stay at 0.
///
/// The equations are linear. The prior is not: its density is zero where a body is not physically consistent. Newton's
/// method solves both together, first with a heavy prior that stays far from that edge (Boyd and Vandenberghe, *Convex
/// Optimization*, 2004, section 11.3). The other coordinates follow from those of the bodies.
pub fn body_step(
    model: &Model,
    actives: &[Active],
    free: &[(usize, usize)],
    (normal, right): (&DMatrix<f64>, &DVector<f64>),
    used: &[bool],
    damping: f64,
) -> Option<DVector<f64>> {
    let own: Vec<Own> = bodies(model, actives)
        .filter(|(_, body)| body.inertia.mass_kg() > 0.0)
        .map(|(i, body)| Own {
            body,
            coordinates: of_body(free, i),
        })
        .filter(|own| !own.coordinates.is_empty())
        .collect();
    if own.is_empty() {
        return solved(normal, right, used, damping);
    }
    let inner: Vec<usize> = own
        .iter()
        .flat_map(|o| o.coordinates.iter().map(|c| c.0))
        .collect();
    let others: Vec<bool> = (0..free.len())
        .map(|k| used[k] && !inner.contains(&k))
        .collect();
    let pick = |vector: &DVector<f64>| {
        DVector::from_iterator(inner.len(), inner.iter().map(|&k| vector[k]))
    };
    // Schur's complement: what the equations say of the bodies once the others follow.
    let alone = solved(normal, right, &others, damping)?;
    let mut complement = DMatrix::from_fn(inner.len(), inner.len(), |a, b| {
        normal[(inner[a], inner[b])] * if a == b { 1.0 + damping } else { 1.0 }
    });
    let mut following = Vec::with_capacity(inner.len());
    for (b, &k) in inner.iter().enumerate() {
        let follows = solved(normal, &normal.column(k).into_owned(), &others, damping)?;
        for (a, &other) in inner.iter().enumerate() {
            complement[(a, b)] -= normal.column(other).dot(&follows);
        }
        following.push(follows);
    }
    let side = pick(right) - pick(&(normal * &alone));
    let within = Within {
        own: &own,
        complement,
        side,
    };
    let step = within.solve()?;
    let mut all = alone;
    for ((&k, follows), step) in inner.iter().zip(&following).zip(&step) {
        all -= follows * *step;
        all[k] = *step;
    }
    Some(all)
}

/// A body before the step, and which of its parameters are free: where among the free coordinates, and which of the ten.
struct Own {
    body: Body,
    coordinates: Vec<(usize, usize)>,
}

/// What is to be solved for the bodies alone: least of `½ dᵀ C d - sᵀ d` less the logarithm of the prior.
struct Within<'a> {
    own: &'a [Own],
    complement: DMatrix<f64>,
    side: DVector<f64>,
}

impl Within<'_> {
    fn solve(&self) -> Option<DVector<f64>> {
        let mut step = DVector::zeros(self.side.len());
        // The first weight is the largest possible gain: with it the prior matters.
        let ridge =
            DMatrix::from_diagonal(&(self.complement.diagonal() * RIDGE).add_scalar(1e-300));
        let free = (&self.complement + ridge).cholesky()?.solve(&self.side);
        let mut weight = (0.5 * self.side.dot(&free)).max(1.0);
        loop {
            self.centre(&mut step, weight)?;
            if weight <= 1.0 {
                return Some(step);
            }
            weight = (weight * ROUND).max(1.0);
        }
    }

    /// Newton's method for one weight of the prior.
    fn centre(&self, step: &mut DVector<f64>, weight: f64) -> Option<()> {
        let mut here = self.objective(step, weight);
        for _ in 0..MOST_STEPS {
            let mut curvature = self.complement.clone();
            let mut slope = &self.side - &self.complement * &*step;
            for (first, own, body) in self.moved(step) {
                let (information, gradient) = about(&body);
                for (a, &(_, c)) in own.coordinates.iter().enumerate() {
                    slope[first + a] += weight * gradient[c];
                    for (b, &(_, d)) in own.coordinates.iter().enumerate() {
                        curvature[(first + a, first + b)] += weight * information[(c, d)];
                    }
                }
            }
            let used = vec![true; slope.len()];
            let direction = solved(&curvature, &slope, &used, 0.0)?;
            if slope.dot(&direction) < CONVERGED * weight {
                break;
            }
            let mut share = 1.0;
            let mut gained = false;
            for _ in 0..MOST_HALVINGS {
                let there = &*step + &direction * share;
                let objective = self.objective(&there, weight);
                if objective < here {
                    (*step, here, gained) = (there, objective, true);
                    break;
                }
                share *= 0.5;
            }
            if !gained {
                break;
            }
        }
        Some(())
    }

    fn objective(&self, step: &DVector<f64>, weight: f64) -> f64 {
        let prior: f64 = self.moved(step).map(|(_, _, body)| density_of(&body)).sum();
        0.5 * (&self.complement * step).dot(step) - self.side.dot(step) - weight * prior
    }

    /// The bodies after a step: where their coordinates begin, what they were, and what they are.
    fn moved(&self, step: &DVector<f64>) -> impl Iterator<Item = (usize, &Own, Body)> {
        let mut first = 0;
        self.own.iter().map(move |own| {
            let begin = first;
            first += own.coordinates.len();
            let mut parameters: [f64; BODY] = own.body.inertia.parameters();
            for (&(_, c), step) in own.coordinates.iter().zip(step.iter().skip(begin)) {
                parameters[c] += step;
            }
            let inertia = Inertia::from_parameters(parameters);
            (
                begin,
                own,
                Body {
                    inertia,
                    ..own.body
                },
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::fit::body_prior::log_density;
    use crate::fit::body_prior::tests::{carried, free, model};
    use crate::physics::library;

    /// Normal equations that ask for a body as precisely as these standard deviations say.
    fn asking(
        here: &Inertia,
        wanted: &Inertia,
        deviations: [f64; BODY],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let information = deviations.map(|deviation| 1.0 / (deviation * deviation));
        let (wanted, here) = (wanted.parameters(), here.parameters());
        let away = wanted.iter().zip(here).map(|(a, b)| a - b);
        let right = DVector::from_iterator(BODY, away.zip(information).map(|(d, i)| d * i));
        (
            DMatrix::from_diagonal(&DVector::from_row_slice(&information)),
            right,
        )
    }

    /// The step of all parameters of one body.
    fn whole_step(actives: &[Active], asked: (&DMatrix<f64>, &DVector<f64>)) -> DVector<f64> {
        body_step(&model(), actives, &free(), asked, &[true; BODY], 0.0).unwrap()
    }

    fn after(actives: &[Active], step: &DVector<f64>) -> Vec<Active> {
        let mut there = actives.to_vec();
        for (value, step) in there[0].coordinates.iter_mut().zip(step) {
            *value += step;
        }
        there
    }

    #[test]
    fn what_is_measured_precisely_is_reached_from_afar() {
        let here = Inertia::new(1.0, [0.0, 0.0, 0.1], [1e-5, 0.0, 0.0, 1e-5, 0.0, 1.5e-5]);
        let wanted = Inertia::new(
            0.3,
            [0.03, -0.02, 0.05],
            [4e-4, 0.0, 0.0, 5e-4, 0.0, 4.5e-4],
        );
        let actives = carried(here);
        let (normal, right) = asking(&here, &wanted, [1e-6; BODY]);
        let step = whole_step(&actives, (&normal, &right));
        let there = after(&actives, &step);
        for (value, wanted) in there[0].coordinates.iter().zip(wanted.parameters()) {
            assert!((value - wanted).abs() < 1e-5, "{value} instead of {wanted}");
        }
    }

    #[test]
    fn an_impossible_inertia_that_is_hardly_measured_leaves_the_rest_as_measured() {
        let here = Inertia::new(0.5, [0.0; 3], [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3]);
        // The moment about z is sure, the others are so unsure that they came out below zero.
        let wanted =
            Inertia::from_parameters([0.3, 0.01, 0.0, 0.02, -3e-3, 0.0, 0.0, 4e-3, 0.0, 6e-4]);
        let actives = carried(here);
        let mut deviations = [3e-3; BODY];
        deviations[..4].fill(1e-5);
        deviations[9] = 1e-5;
        let (normal, right) = asking(&here, &wanted, deviations);
        let step = whole_step(&actives, (&normal, &right));
        let there = after(&actives, &step);
        assert!(log_density(&model(), &there).is_finite());
        for c in [0, 1, 2, 3, 9] {
            let (value, wanted) = (there[0].coordinates[c], wanted.parameters()[c]);
            assert!(
                (value - wanted).abs() < 4e-5,
                "{c}: {value} instead of {wanted}"
            );
        }
    }

    #[test]
    fn what_is_not_used_stays_and_what_is_no_body_follows() {
        let here = Inertia::new(1.0, [0.0; 3], [2e-2, 0.0, 0.0, 2e-2, 0.0, 2e-2]);
        let mut actives = carried(here);
        let all = library::hypotheses(&model(), true, &BTreeSet::new());
        let friction =
            |h: &&crate::physics::active::Hypothesis| h.effect.name == "coulomb_friction";
        actives.push(all.iter().find(friction).unwrap().with(vec![1.0]));
        let mut all_free = free();
        all_free.push((1, 0));
        let n = BODY + 1;
        let mut normal = DMatrix::from_diagonal_element(n, n, 1e6);
        normal[(0, BODY)] = 5e5;
        normal[(BODY, 0)] = 5e5;
        let mut right = DVector::zeros(n);
        right[BODY] = 1e6;
        let both = body_step(
            &model(),
            &actives,
            &all_free,
            (&normal, &right),
            &[true; BODY + 1],
            0.0,
        )
        .unwrap();
        let left = &right - &normal * &both;
        assert!(
            left[BODY].abs() < 1e-3,
            "the friction solves its own equation"
        );
        let mut used = [true; BODY + 1];
        used[BODY] = false;
        let held = body_step(&model(), &actives, &all_free, (&normal, &right), &used, 0.0).unwrap();
        assert!(held[BODY].abs() <= 0.0);
    }
}
