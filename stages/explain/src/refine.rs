//! All numbers of an explanation fitted at once: Gauss-Newton with Levenberg's damping on the filtered effort, what is at its
//! bound held there (Nocedal and Wright, *Numerical Optimization*, 2006, sections 10.3 and 16.7).

use nalgebra::DVector;
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::active::{Active, Column};
use crate::fit::Fit;
use crate::least_squares::{Products, solved};
use crate::problem::Problem;

const MAX_ITERATIONS: usize = 12;
/// So often the damping is raised for one step.
const MOST_TRIES: usize = 6;
/// A step that gains less log-likelihood than this is the last \[nats\], or less than this share of the distance from
/// another explanation that it is compared with.
const CONVERGED: f64 = 0.02;
const CONVERGED_SHARE: f64 = 0.01;

impl Fit {
    /// Improves all numbers together.
    #[must_use]
    pub fn refined(self, problem: &Problem) -> Self {
        self.refined_at(problem, None, f64::NAN)
    }

    /// Improves the numbers of what touches these joints, all without them; as precisely as is needed to compare it with an
    /// explanation of the likelihood `rival`, or wholly if that is NaN. Bodies become physically consistent.
    #[must_use]
    pub fn refined_at(self, problem: &Problem, joints: Option<&[usize]>, rival: f64) -> Self {
        let free = self.parameters_at(joints);
        if free.is_empty() {
            return self;
        }
        let mut fit = self.consistent(problem);
        let mut damping = 1e-4;
        let mut best = fit.likelihood();
        for _ in 0..MAX_ITERATIONS {
            let jacobian = fit.jacobian_at(problem, joints);
            let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
            let products = Products::new(problem, &columns, &fit.residual, None);
            let ridge = vec![0.0; columns.len()];
            let (normal, right) = products.normal(&fit.variance, &ridge);
            let mut used = vec![true; free.len()];
            let mut gained = None;
            for _ in 0..MOST_TRIES {
                let step = loop {
                    let step = solved(&normal, &right, &used, damping);
                    let Some(out) = step.as_ref().map(|step| fit.out(problem, &free, step)) else {
                        break None;
                    };
                    let held = (0..free.len()).filter(|&k| used[k] && out[k]);
                    let held: Vec<usize> = held.collect();
                    if held.is_empty() {
                        break step;
                    }
                    for k in held {
                        used[k] = false;
                    }
                };
                let Some(step) = step else {
                    damping *= 10.0;
                    continue;
                };
                let moved = fit.moved(problem, &free, &step);
                let next = Self::beside(problem, moved, Some(&fit));
                let likelihood = next.likelihood();
                if likelihood > best {
                    gained = Some(likelihood - best);
                    best = likelihood;
                    fit = next;
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 8.0;
            }
            let enough = CONVERGED.max(CONVERGED_SHARE * (best - rival).abs());
            if gained.is_none_or(|gained| gained < enough) {
                break;
            }
        }
        fit
    }

    /// The same with bodies whose mass is nowhere negative.
    fn consistent(self, problem: &Problem) -> Self {
        let mut actives = self.actives.clone();
        let mut odd = false;
        for active in &mut actives {
            odd |= active.make_consistent();
        }
        if odd {
            Self::beside(problem, actives, Some(&self))
        } else {
            self
        }
    }

    /// Which coordinates a step would take out of their bounds from where they meet them already; of a body the inertia, if
    /// it has no mass to spare in some direction.
    fn out(&self, problem: &Problem, free: &[(usize, usize)], step: &DVector<f64>) -> Vec<bool> {
        let odd: Vec<bool> = (0..self.actives.len())
            .map(|i| {
                let mut moved = self.actives[i].clone();
                let own = free.iter().zip(step).filter(|((of, _), _)| *of == i);
                own.for_each(|((_, c), step)| moved.coordinates[*c] += step);
                moved.make_consistent()
            })
            .collect();
        let one = |(&(i, c), step): (&(usize, usize), &f64)| {
            let active = &self.actives[i];
            let (lower, upper) = bounds(problem, active, c);
            let value = active.coordinates[c];
            (value <= lower && *step < 0.0)
                || (value >= upper && *step > 0.0)
                || (odd[i]
                    && active.hypothesis.is_inertia(c)
                    && *step != 0.0
                    && active.is_at_edge())
        };
        free.iter().zip(step).map(one).collect()
    }

    /// The physics with its coordinates moved by `step`, within their bounds.
    fn moved(
        &self,
        problem: &Problem,
        parameters: &[(usize, usize)],
        step: &DVector<f64>,
    ) -> Vec<Active> {
        let mut actives = self.actives.clone();
        for (&(i, c), step) in parameters.iter().zip(step) {
            let (lower, upper) = bounds(problem, &actives[i], c);
            let value = &mut actives[i].coordinates[c];
            *value = (*value + step).clamp(lower, upper);
        }
        for active in &mut actives {
            active.make_consistent();
        }
        actives
    }
}

/// Lowest and highest value of a coordinate.
fn bounds(problem: &Problem, active: &Active, c: usize) -> (f64, f64) {
    match active.kind(c) {
        CoordinateKind::Factor { minimum, .. } => (minimum, f64::INFINITY),
        CoordinateKind::Shape {
            lower,
            upper,
            scale,
            ..
        } => match scale {
            Scale::OfEffort => {
                let largest = problem.largest_effort[active.hypothesis.place.joint];
                (lower * largest, 1.1 * upper * largest)
            }
            Scale::Log | Scale::Linear => (lower, upper),
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }
}
