//! Progress of a computation: a bar on a terminal; elsewhere, as in a pipe or a log, an occasional line.

mod lines;

use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::output::Output;
use crate::{interrupt, terminal};
use lines::Lines;

/// Number of steps of the bar; a recording's part is at least one of them.
const STEPS: f64 = 10_000.0;
/// Poll interval for a line that is due.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Option to suppress the progress display.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Quiet {
    /// Show no progress: only results, warnings and errors.
    #[arg(short, long)]
    quiet: bool,
}

/// Kind of progress display.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Show {
    /// Nothing.
    Nothing,
    /// A bar, where standard error is a terminal.
    Bar,
    /// A bar, or lines where there is no terminal.
    BarOrLines,
}

impl Quiet {
    /// Returns the kind of display of a command that writes to `out`. Output to memory gets no lines, because it is
    /// only read at the end.
    pub fn show(self, out: &Output) -> Show {
        match (self.quiet, out) {
            (true, _) => Show::Nothing,
            (false, Output::Terminal) => Show::BarOrLines,
            (false, Output::Memory(..)) => Show::Bar,
        }
    }
}

/// Progress of all recordings together.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    done: Arc<Mutex<Parts>>,
    /// Stops the thread that writes lines, when dropped.
    _ends: Option<mpsc::Sender<()>>,
}

/// Progress of each recording.
#[derive(Debug)]
struct Parts {
    /// Progress of each recording, from 0 to 1.
    fractions: Vec<f64>,
    sum: f64,
    /// Current step.
    what: String,
    /// Reported progress, and the time when it was reached.
    said: (f64, Instant),
}

/// Returns standard error if it can redraw, else a hidden target.
pub fn draw_target() -> ProgressDrawTarget {
    if terminal::can_redraw() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    }
}

impl Progress {
    /// Creates the display of progress over `count` recordings.
    pub fn new(count: usize, show: Show) -> Self {
        let target = match show {
            Show::Nothing => ProgressDrawTarget::hidden(),
            Show::Bar | Show::BarOrLines => draw_target(),
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), target);
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {elapsed} (left: {eta})");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let began = Instant::now();
        let done = Arc::new(Mutex::new(Parts {
            fractions: vec![0.0; count],
            sum: 0.0,
            what: String::new(),
            said: (0.0, began),
        }));
        let lines = show == Show::BarOrLines && !terminal::can_redraw();
        let ends = lines.then(|| tell_lines(&done, began));
        Self {
            bar,
            done,
            _ends: ends,
        }
    }

    /// Creates the display of a single piece of work that reports its steps ([`Progress::doing`]). The duration of a
    /// step is unknown, so the bar shows no remaining time.
    pub fn of_work(show: Show) -> Self {
        let this = Self::new(1, show);
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {elapsed} {wide_msg}");
        this.bar
            .set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        this
    }

    /// Reports that the work has reached `fraction` and continues with the step `what`. If the fraction does not grow
    /// from one step to the next, the bar still advances, by less each time, to show that the work is alive.
    /// Repeating a step does not advance it.
    pub fn doing(&self, fraction: f64, what: &str) {
        const CREEP: f64 = 0.02;
        let shown = {
            let mut done = locked(&self.done);
            done.say(fraction);
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

    /// Sets the progress of recording `index`.
    pub fn set(&self, index: usize, fraction: f64) {
        let mut done = locked(&self.done);
        let Some(own) = done.fractions.get_mut(index) else {
            return;
        };
        let more = fraction - std::mem::replace(own, fraction);
        done.sum += more;
        let mean = done.sum / done.fractions.len() as f64;
        done.say(mean);
        interrupt::far(mean);
        self.bar.set_position((mean * STEPS) as u64);
    }
}

impl Parts {
    fn say(&mut self, fraction: f64) {
        if fraction > self.said.0 {
            self.said = (fraction, Instant::now());
        }
    }

    /// Returns the numbers of completed and of all recordings, if there are several.
    fn counted(&self) -> Option<(usize, usize)> {
        let whole = self.fractions.iter().filter(|fraction| **fraction >= 1.0);
        let all = self.fractions.len();
        (all > 1).then(|| (whole.count(), all))
    }
}

/// Locks the progress. A panic in another thread does not matter, because every change is a single step.
fn locked(parts: &Mutex<Parts>) -> MutexGuard<'_, Parts> {
    parts.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes lines to standard error until the result is dropped, in a thread of its own because a step may take
/// minutes.
fn tell_lines(done: &Arc<Mutex<Parts>>, began: Instant) -> mpsc::Sender<()> {
    let (ends, ended) = mpsc::channel::<()>();
    let done = Arc::clone(done);
    std::thread::spawn(move || {
        let mut lines = Lines::default();
        while ended.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
            let due = {
                let done = locked(&done);
                let (fraction, at) = done.said;
                let far = lines::Far {
                    what: &done.what,
                    fraction,
                    reached: at - began,
                    counted: done.counted(),
                };
                lines.due(began.elapsed(), &far)
            };
            if let Some(line) = due {
                eprintln!("{line}");
            }
        }
    });
    ends
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
        let progress = Progress::of_work(Show::Nothing);
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
        // The remaining time follows from the reported progress, not from the position of the bar.
        assert!((locked(&progress.done).said.0 - 0.6).abs() < 1e-9);
    }

    #[test]
    fn only_a_command_that_speaks_to_people_tells_lines() {
        let loud = Quiet::default();
        let memory = Output::Memory(String::new(), String::new());
        assert_eq!(loud.show(&Output::Terminal), Show::BarOrLines);
        assert_eq!(loud.show(&memory), Show::Bar);
        let quiet = Quiet { quiet: true };
        assert_eq!(quiet.show(&Output::Terminal), Show::Nothing);
    }
}
