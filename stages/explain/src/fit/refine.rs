//! All numbers of an explanation fitted at once: Gauss-Newton with Levenberg's damping on the filtered effort, what is at its
//! bound held there (Nocedal and Wright, *Numerical Optimization*, 2006, sections 10.3 and 16.7).

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::body_step::body_step;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::physics::active::Active;
use crate::physics::friction::least;

const MAX_ITERATIONS: usize = 20;
/// So often the damping is raised for one step.
const MOST_TRIES: usize = 6;
/// A step that gains less log-likelihood than this is the last \[nats\], or less than this share of the distance from
/// another explanation that it is compared with.
const CONVERGED: f64 = 0.01;
const CONVERGED_SHARE: f64 = 0.01;

/// Numbers that a fit is held near, and how firmly.
#[derive(Debug)]
pub(crate) struct Anchor {
    centre: DVector<f64>,
    weight: DVector<f64>,
}

impl Anchor {
    /// The numbers of a fit that touch these joints, with a share of what all recordings tell of them.
    pub fn new(problem: &Problem, fit: &Fit, joints: &[usize], share: f64) -> Self {
        let jacobian = fit.jacobian_at(problem, Some(joints));
        let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
        let products = Products::new(problem, &columns, &fit.residual, None);
        let (normal, _) = products.normal(&fit.variance, &vec![0.0; columns.len()]);
        Self {
            centre: numbers(fit, &fit.parameters_at(Some(joints))),
            weight: normal.diagonal() * share,
        }
    }

    /// Logarithm of its density, but for a constant.
    fn log_density(&self, numbers: &DVector<f64>) -> f64 {
        let off = numbers - &self.centre;
        -0.5 * off.component_mul(&off).dot(&self.weight)
    }
}

fn numbers(fit: &Fit, free: &[(usize, usize)]) -> DVector<f64> {
    let all = free.iter().map(|&(i, c)| fit.actives[i].coordinates[c]);
    DVector::from_iterator(free.len(), all)
}

impl Fit {
    /// Improves all numbers together.
    #[must_use]
    pub fn refined(self, problem: &Problem) -> Self {
        self.refined_at(problem, None, f64::NAN)
    }

    /// Improves the numbers of what touches these joints, all without them; as precisely as is needed to compare it with an
    /// explanation of the likelihood `rival`, or wholly if that is NaN. Bodies become physically consistent and are fitted with
    /// their prior.
    #[must_use]
    pub fn refined_at(self, problem: &Problem, joints: Option<&[usize]>, rival: f64) -> Self {
        self.improved(problem, joints, rival, None)
    }

    /// The same, held near an anchor.
    #[must_use]
    pub(crate) fn refined_near(self, problem: &Problem, joints: &[usize], anchor: &Anchor) -> Self {
        self.improved(problem, Some(joints), f64::NAN, Some(anchor))
    }

    fn improved(
        self,
        problem: &Problem,
        joints: Option<&[usize]>,
        rival: f64,
        anchor: Option<&Anchor>,
    ) -> Self {
        let free = self.parameters_at(joints);
        if free.is_empty() {
            return self;
        }
        let mut fit = self.consistent(problem);
        let mut damping = 1e-4;
        let objective = |fit: &Self| {
            let near = anchor.map_or(0.0, |anchor| anchor.log_density(&numbers(fit, &free)));
            fit.likelihood() + body_prior::log_density(&problem.model, &fit.actives) + near
        };
        let mut best = objective(&fit);
        for _ in 0..MAX_ITERATIONS {
            let jacobian = fit.jacobian_at(problem, joints);
            let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
            let products = Products::new(problem, &columns, &fit.residual, None);
            let ridge = vec![0.0; columns.len()];
            let (mut normal, mut right) = products.normal(&fit.variance, &ridge);
            if let Some(Anchor { centre, weight }) = anchor {
                normal += DMatrix::from_diagonal(weight);
                right += (centre - numbers(&fit, &free)).component_mul(weight);
            }
            let mut used = vec![true; free.len()];
            let mut gained = None;
            for _ in 0..MOST_TRIES {
                let step = loop {
                    let step = body_step(
                        &problem.model,
                        &fit.actives,
                        &free,
                        (&normal, &right),
                        &used,
                        damping,
                    );
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
                let reached = objective(&next);
                if reached > best {
                    gained = Some(reached - best);
                    best = reached;
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
        if body_prior::make_consistent(&problem.model, &mut actives) {
            Self::beside(problem, actives, Some(&self))
        } else {
            self
        }
    }

    /// Which coordinates a step would take out of their bounds from where they meet them already.
    fn out(&self, problem: &Problem, free: &[(usize, usize)], step: &DVector<f64>) -> Vec<bool> {
        let one = |(&(i, c), step): (&(usize, usize), &f64)| {
            let active = &self.actives[i];
            let (lower, upper) = bounds(problem, active, c);
            let value = active.coordinates[c];
            (value <= lower && *step < 0.0) || (value >= upper && *step > 0.0)
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
        body_prior::make_consistent(&problem.model, &mut actives);
        actives
    }
}

/// Lowest and highest value of a coordinate.
fn bounds(problem: &Problem, active: &Active, c: usize) -> (f64, f64) {
    match active.kind(c) {
        CoordinateKind::Factor { minimum, .. } => {
            (least(problem, active.hypothesis, minimum), f64::INFINITY)
        }
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
