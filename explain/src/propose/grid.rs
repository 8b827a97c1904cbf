//! The grid on which the shapes of a hypothesis are searched.

use tauscope_dynamics::terms::{CoordinateKind, PlaceKind, Scale};

use crate::data::problem::Problem;
use crate::physics::active::Hypothesis;

/// Most grid steps of a shape that all joints share: its columns cost the most, and the fit refines the shape later.
/// Resolution: changes the computing time.
const MOST_STEPS_OF_ALL: usize = 12;

/// The grid of a hypothesis' shapes, with factors 0.
pub fn shapes(problem: &Problem, hypothesis: Hypothesis) -> Vec<Vec<f64>> {
    let mut grid = vec![Vec::new()];
    for coordinate in hypothesis.effect.coordinates {
        let values: Vec<f64> = match coordinate.kind {
            CoordinateKind::Shape {
                lower,
                upper,
                steps,
                scale,
            } => {
                let of = |share: f64| match scale {
                    Scale::Linear | Scale::Waves => lower + share * (upper - lower),
                    Scale::Log => lower * (upper / lower).powf(share),
                    Scale::OfEffort => {
                        let largest = problem.largest_effort[hypothesis.place.joint];
                        largest * (lower + share * (upper - lower))
                    }
                };
                let all = hypothesis.effect.place == PlaceKind::All;
                let steps = if all {
                    steps.min(MOST_STEPS_OF_ALL)
                } else {
                    steps
                };
                let most = match scale {
                    Scale::Waves => problem.most_waves(hypothesis.place.joint).max(lower),
                    _ => f64::INFINITY,
                };
                let all = (0..steps).map(|k| of(k as f64 / (steps - 1).max(1) as f64));
                all.filter(|value| *value <= most).collect()
            }
            _ => vec![0.0],
        };
        let longer = |start: &Vec<f64>| {
            let start = start.clone();
            values
                .iter()
                .map(move |&value| {
                    let mut longer = start.clone();
                    longer.push(value);
                    longer
                })
                .collect::<Vec<_>>()
        };
        grid = grid.iter().flat_map(longer).collect();
    }
    grid
}
