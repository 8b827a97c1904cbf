//! The explanations that a search was at, round by round.

use crate::physics::active::Hypothesis;

/// The explanations that a search was at, and what each was left for.
#[derive(Debug, Default)]
pub struct Visited(Vec<(Vec<Hypothesis>, f64)>);

impl Visited {
    /// Adds the effects of an explanation, and the gain by which it was left \[nats\].
    pub fn add(&mut self, effects: Vec<Hypothesis>, gained: f64) {
        self.0.push((effects, gained));
    }

    /// Whether `next` closes a circle, and the last explanation is that of the circle which was left for the least gain. The
    /// noise is estimated anew next to each explanation, so each of two can seem better from the other.
    pub fn ends_with_least_gain(&self, next: &[Hypothesis]) -> bool {
        let Some((last, gained)) = self.0.last().filter(|(last, _)| last != next) else {
            return false;
        };
        let circle = self.0.iter().skip_while(|(effects, _)| effects != next);
        let mut gains = circle.filter(|(effects, _)| effects != last).peekable();
        gains.peek().is_some() && gains.all(|(_, other)| gained <= other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::at_joint;

    /// Guards against a sound arm whose search went to and fro between an explanation with a delay and one without.
    #[test]
    fn a_search_that_goes_to_and_fro_ends_where_it_was_left_for_least() {
        let with = vec![at_joint("viscous_friction", 0), at_joint("torque_delay", 0)];
        let without = vec![at_joint("viscous_friction", 0)];
        let mut visited = Visited::default();
        visited.add(without.clone(), 4.0);
        assert!(!visited.ends_with_least_gain(&with));
        visited.add(with.clone(), 70.0);
        assert!(!visited.ends_with_least_gain(&without));
        visited.add(without.clone(), 3.8);
        assert!(visited.ends_with_least_gain(&with));
        assert!(!visited.ends_with_least_gain(&without));
    }
}
