//! Intervals of a recording that are searched for a temporary effect.

/// Number of steps into which a recording is divided to search for changes; searches of intervals may use more.
/// Resolution: times are refined afterwards.
pub const STEPS: usize = 100;
/// Longest interval on the finest grid, in steps, in a recording of more than [`STEPS`] steps. Longer intervals are
/// searched on grids whose step doubles with their length. The shortest intervals are thus found in any
/// recording, and the work grows at most linearly with its length.
/// Resolution: the ends of an interval are searched to within a twentieth of its length.
const FINE_STEPS: usize = 40;
/// An interval in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Steps {
    /// First step of the interval.
    pub from: usize,
    /// First step after the interval.
    pub to: usize,
}

impl Steps {
    /// Returns whether both intervals contain a common step.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.from < other.to && other.from < self.to
    }
}

/// Returns the searched intervals of at least `shortest` steps in a recording of `steps` steps: all intervals of a
/// short recording; in a long one, longer intervals only on a coarser grid.
pub fn intervals(steps: usize, shortest: usize) -> Vec<Steps> {
    let mut all = Vec::new();
    let mut stride = 1;
    let mut lengths = shortest..=if steps <= STEPS + 2 {
        steps
    } else {
        FINE_STEPS
    };
    while lengths.start() * stride <= steps {
        for from in (0..steps).step_by(stride) {
            let ends = lengths.clone().map(|length| from + length * stride);
            let ends = ends.take_while(|to| *to <= steps);
            all.extend(ends.map(|to| Steps { from, to }));
        }
        // Lengths of 21 to 40 strides: the next grid begins where this one ends, and a length is at least 21 times
        // its grid step. For a short recording, the loop ends here.
        stride *= 2;
        lengths = lengths.end() / 2 + 1..=*lengths.end();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest intersection over union of a searched interval with this one.
    fn overlap(all: &[Steps], from: usize, to: usize) -> f64 {
        let share = |other: &Steps| {
            let common = other.to.min(to).saturating_sub(other.from.max(from));
            common as f64 / (other.to.max(to) - other.from.min(from)) as f64
        };
        all.iter().map(share).fold(0.0, f64::max)
    }

    #[test]
    fn an_interval_of_any_length_is_found_in_a_log_of_any_length() {
        for steps in [100, 820, 6000] {
            let all = intervals(steps, 4);
            for length in [4, 7, 33, 41, 79] {
                // All of it lies within the log.
                let from = (steps / 3 + 1).min(steps - length);
                let share = overlap(&all, from, from + length);
                assert!(share > 0.9, "{length} of {steps}: {share}");
            }
            let share = overlap(&all, 0, steps);
            assert!(share > 0.9, "all of {steps}: {share}");
        }
    }

    #[test]
    fn the_work_grows_no_faster_than_the_log() {
        let [short, long] = [1000, 10_000].map(|steps| intervals(steps, 4).len());
        assert!(long < 11 * short, "{short} {long}");
    }

    #[test]
    fn every_interval_lies_within_the_log() {
        for steps in [3, 4, 5, 101, 103, 500] {
            let all = intervals(steps, 4);
            assert!(
                all.iter()
                    .all(|one| one.from + 4 <= one.to && one.to <= steps)
            );
        }
    }
}
