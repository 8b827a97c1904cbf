//! A progress bar over recordings, sources or the steps of a computation: on a terminal, none in a pipe.

use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::{interrupt, terminal};

/// Steps of the bar; a recording's part is at least one of them.
const STEPS: f64 = 10_000.0;

/// How far the recordings are, together.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    done: Mutex<Parts>,
}

/// How far each recording is.
#[derive(Debug)]
struct Parts {
    /// From 0 to 1.
    fractions: Vec<f64>,
    sum: f64,
    /// The step that was told last.
    what: String,
}

/// Standard error, where it can redraw.
pub fn draw_target() -> ProgressDrawTarget {
    if terminal::can_redraw() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    }
}

impl Progress {
    /// A bar over `count` recordings.
    pub fn new(count: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), draw_target());
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {elapsed} (left: {eta})");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self {
            bar,
            done: Mutex::new(Parts {
                fractions: vec![0.0; count],
                sum: 0.0,
                what: String::new(),
            }),
        }
    }

    /// A bar over one piece of work that says what it does ([`Progress::doing`]). Nobody knows how long
    /// its steps take, so it does not say what is left.
    pub fn of_work() -> Self {
        let this = Self::new(1);
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {elapsed} {wide_msg}");
        this.bar
            .set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        this
    }

    /// The work has come to `fraction` and goes on with `what`. Where the fraction does not grow from one
    /// step to the next, the bar creeps on, ever slower, so that it is seen to live; the same step told
    /// again is no further one.
    pub fn doing(&self, fraction: f64, what: &str) {
        const CREEP: f64 = 0.02;
        let shown = {
            let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
            let is_next = done.what != what;
            if is_next {
                what.clone_into(&mut done.what);
            }
            let Some(shown) = done.fractions.first_mut() else {
                return;
            };
            let crept = if is_next { CREEP * (1.0 - *shown) } else { 0.0 };
            *shown = fraction.max(*shown + crept).min(1.0);
            *shown
        };
        self.bar.set_position((shown * STEPS) as u64);
        self.bar.set_message(what.to_owned());
        interrupt::far(shown);
        interrupt::doing(what);
    }

    /// Recording `index` has come to `fraction`.
    pub fn set(&self, index: usize, fraction: f64) {
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(own) = done.fractions.get_mut(index) else {
            return;
        };
        let more = fraction - std::mem::replace(own, fraction);
        done.sum += more;
        let mean = done.sum / done.fractions.len() as f64;
        interrupt::far(mean);
        self.bar.set_position((mean * STEPS) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(progress: &Progress) -> f64 {
        progress.bar.position() as f64 / STEPS
    }

    #[test]
    fn a_step_that_is_told_again_and_again_moves_nothing() {
        let progress = Progress::of_work();
        for _ in 0..1000 {
            progress.doing(0.1, "fitting the twin");
        }
        assert!(
            (shown(&progress) - 0.1).abs() < 0.03,
            "{}",
            shown(&progress)
        );
        progress.doing(0.1, "the next step");
        assert!(shown(&progress) > 0.1, "it is seen to live");
        progress.doing(0.6, "the next step");
        assert!((shown(&progress) - 0.6).abs() < 1e-3);
    }
}
