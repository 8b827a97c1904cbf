//! Figures per sample: F1, best F1 over the thresholds of Tajiri and Iwamoto, section IV-C, and AUC.

use std::cmp::Ordering;

use crate::labels::Truth;

/// Scores with their labels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Labelled {
    /// The scores.
    pub scores: Vec<f64>,
    /// Whether each score is of a contact.
    pub positive: Vec<bool>,
}

/// Label of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flag {
    /// Contact-free.
    Free,
    /// In contact.
    Contact,
    /// In a contact too weak to be scored.
    Ignored,
}

/// Labels the samples of a recording.
pub fn flags(t: &[f64], truth: &Truth) -> Vec<Flag> {
    let mut flags = vec![Flag::Free; t.len()];
    for event in &truth.events {
        for (flag, t) in flags.iter_mut().zip(t) {
            if (event.t_on..=event.t_off).contains(t) {
                *flag = match (event.ignore, *flag) {
                    (true, Flag::Free) => Flag::Ignored,
                    (true, other) => other,
                    (false, _) => Flag::Contact,
                };
            }
        }
    }
    flags
}

impl Labelled {
    /// Adds a recording's samples, except ignored ones.
    pub fn add(&mut self, scores: &[f64], flags: &[Flag]) {
        for (score, flag) in scores.iter().zip(flags) {
            if *flag != Flag::Ignored {
                self.scores.push(*score);
                self.positive.push(*flag == Flag::Contact);
            }
        }
    }

    /// Adds a recording's windows of `length` samples, with the score at their last sample. A window is positive if
    /// any of its samples is. A window without a positive sample is left out if it contains an ignored one.
    pub fn add_windows(&mut self, scores: &[f64], flags: &[Flag], length: usize) {
        let windows = flags.windows(length.max(1));
        for (score, window) in scores.iter().skip(length.max(1) - 1).zip(windows) {
            let positive = window.contains(&Flag::Contact);
            if positive || !window.contains(&Flag::Ignored) {
                self.scores.push(*score);
                self.positive.push(positive);
            }
        }
    }

    /// Share of positives.
    pub fn share(&self) -> f64 {
        self.positives() as f64 / self.positive.len() as f64
    }

    fn positives(&self) -> usize {
        self.positive.iter().filter(|positive| **positive).count()
    }

    /// F1, the harmonic mean of precision and recall, at a threshold; a score at the threshold is an alarm. NaN
    /// without positives.
    pub fn f1(&self, threshold: f64) -> f64 {
        let (mut hits, mut alarms) = (0_u64, 0_u64);
        for (score, positive) in self.scores.iter().zip(&self.positive) {
            let alarm = *score >= threshold;
            alarms += u64::from(alarm);
            hits += u64::from(alarm && *positive);
        }
        match self.positives() {
            0 => f64::NAN,
            // 2 TP / (2 TP + FP + FN).
            positives => 2.0 * hits as f64 / (alarms as f64 + positives as f64),
        }
    }

    /// The best F1 over the thresholds mean + i standard deviations, and its i.
    pub fn best_f1(&self, mean: f64, standard_deviation: f64) -> (f64, f64) {
        let mut best = (f64::NAN, f64::NAN);
        for i in sigmas() {
            let f1 = self.f1(mean + i * standard_deviation);
            if best.0.is_nan() || f1 > best.0 {
                best = (f1, i);
            }
        }
        best
    }

    /// Area under the receiver operating characteristic: the probability that a positive scores higher than a
    /// negative, with ties counted half; NaN without positives or without negatives.
    pub fn auc(&self) -> f64 {
        let positives = self.positives() as f64;
        let negatives = self.positive.len() as f64 - positives;
        if positives == 0.0 || negatives == 0.0 {
            return f64::NAN;
        }
        let (mut area, mut below) = (0.0, 0.0);
        for (up, down) in self.steps().into_iter().rev() {
            area += up * (below + 0.5 * down);
            below += down;
        }
        area / (positives * negatives)
    }

    /// Numbers of positives and negatives at each distinct score, from the highest to the lowest.
    fn steps(&self) -> Vec<(f64, f64)> {
        let mut order: Vec<usize> = (0..self.scores.len()).collect();
        order.sort_unstable_by(|a, b| self.scores[*b].total_cmp(&self.scores[*a]));
        let mut steps: Vec<(f64, f64)> = Vec::new();
        let mut before = f64::NAN;
        for index in order {
            // A tie must share one step; the comparison also treats 0 and -0 as equal.
            if self.scores[index].partial_cmp(&before) != Some(Ordering::Equal) {
                steps.push((0.0, 0.0));
                before = self.scores[index];
            }
            if let Some((up, down)) = steps.last_mut() {
                *up += f64::from(u8::from(self.positive[index]));
                *down += f64::from(u8::from(!self.positive[index]));
            }
        }
        steps
    }

    /// The receiver operating characteristic as (false positive rate, true positive rate), from (0, 0) to
    /// (1, 1), thinned to about `count` points.
    pub fn roc(&self, count: usize) -> Vec<(f64, f64)> {
        let positives = self.positives() as f64;
        let negatives = self.positive.len() as f64 - positives;
        if positives == 0.0 || negatives == 0.0 {
            return Vec::new();
        }
        let step = 1.0 / count.max(1) as f64;
        let (mut up, mut down) = (0.0, 0.0);
        let mut points = vec![(0.0, 0.0)];
        for (ups, downs) in self.steps() {
            up += ups / positives;
            down += downs / negatives;
            let (x, y) = points[points.len() - 1];
            if (down - x) + (up - y) >= step {
                points.push((down, up));
            }
        }
        points.push((1.0, 1.0));
        points
    }
}

/// The i of the thresholds: 0 to 1 by 0.1, and 2 to 5.
pub fn sigmas() -> impl Iterator<Item = f64> {
    let fine = (0..=10).map(|i| f64::from(i) * 0.1);
    fine.chain([2.0, 3.0, 4.0, 5.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::labels::TrueEvent;

    fn labelled(scores: &[f64], positive: &[u8]) -> Labelled {
        Labelled {
            scores: scores.to_vec(),
            positive: positive.iter().map(|p| *p == 1).collect(),
        }
    }

    #[test]
    fn f1_counts_an_equal_score_as_an_alarm() {
        // At 2: alarms 2, 3, 4 of which 2 and 4 are right; 1 is missed.
        let some = labelled(&[1.0, 2.0, 3.0, 4.0, 0.5], &[1, 1, 0, 1, 0]);
        assert!((some.f1(2.0) - 4.0 / 6.0).abs() < 1e-15);
        assert!(some.f1(9.0).abs() < 1e-15);
    }

    #[test]
    fn auc_counts_ties_half() {
        // Pairs: (3 over 1), (3 over 2), (2 over 1), and a tie of 2 and 2: 3.5 of 4.
        let some = labelled(&[3.0, 2.0, 2.0, 1.0], &[1, 1, 0, 0]);
        let is = |labelled: Labelled, auc: f64| assert!((labelled.auc() - auc).abs() < 1e-15);
        is(some, 3.5 / 4.0);
        is(labelled(&[1.0, 1.0, 1.0], &[1, 0, 0]), 0.5);
        is(labelled(&[0.0, -0.0], &[1, 0]), 0.5);
    }

    #[test]
    fn without_a_contact_there_is_neither_f1_nor_auc() {
        let none = labelled(&[1.0, 2.0], &[0, 0]);
        assert!(none.auc().is_nan() && none.f1(0.0).is_nan() && none.best_f1(0.0, 1.0).0.is_nan());
        assert!(none.roc(10).is_empty());
    }

    #[test]
    fn the_curve_encloses_the_area() {
        let some = labelled(&[3.0, 2.0, 2.0, 1.0], &[1, 1, 0, 0]);
        let roc = some.roc(100);
        assert_eq!(roc[..2], [(0.0, 0.0), (0.0, 0.5)]);
        let area: f64 = (roc.windows(2))
            .map(|pair| (pair[1].0 - pair[0].0) * 0.5 * (pair[0].1 + pair[1].1))
            .sum();
        assert!((area - some.auc()).abs() < 1e-15);
    }

    #[test]
    fn the_best_threshold_is_one_of_the_papers() {
        // Mean 0, sd 1: from i = 2 on only the positive is above.
        let some = labelled(&[1.5, 2.5], &[0, 1]);
        assert_eq!(some.best_f1(0.0, 1.0), (1.0, 2.0));
        assert_eq!(sigmas().count(), 15);
    }

    #[test]
    fn ignored_samples_are_left_out_and_windows_hold_any() {
        use Flag::{Contact, Free, Ignored};

        let event = |t_on, t_off, ignore| TrueEvent {
            t_on,
            t_off,
            ignore,
            ..TrueEvent::default()
        };
        let truth = Truth {
            duration: None,
            events: vec![event(1.0, 2.0, false), event(2.0, 3.0, true)],
        };
        let t = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let flags = flags(&t, &truth);
        assert_eq!(flags, [Free, Contact, Contact, Ignored, Free, Free]);
        let mut single = Labelled::default();
        single.add(&t, &flags);
        assert_eq!(
            single,
            labelled(&[0.0, 1.0, 2.0, 4.0, 5.0], &[0, 1, 1, 0, 0])
        );
        let mut windows = Labelled::default();
        windows.add_windows(&t, &flags, 2);
        assert_eq!(windows, labelled(&[1.0, 2.0, 3.0, 5.0], &[1, 1, 1, 0]));
    }
}
