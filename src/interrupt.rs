//! Ctrl-C and SIGTERM, for all commands but `run`, which ends its stages itself.
//!
//! A command that writes only at its end is terminated at once: a thread waits for the signal, removes unfinished
//! files, reports the progress and exits with code 1. A command with a section that must be completed takes a
//! [`Hold`]: the signal then only sets a flag, which the command polls between its steps ([`is_asked`]), and it
//! reports its progress itself. A second signal terminates it in any case.
//!
//! A command whose output files are useful only as a complete set creates an [`Undo`], which removes them if the
//! command fails or a signal terminates it.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tauscope_archive::whole_file;
use tokio::signal::unix::{SignalKind, signal};

/// Exit code of work that was not completed.
const EXIT_CODE: i32 = 1;

/// Whether a signal has arrived. It guards no other data, so `Relaxed` suffices.
static ASKED: AtomicBool = AtomicBool::new(false);
/// Progress of the work \[percent\]; above 100 if unknown.
static PERCENT: AtomicU32 = AtomicU32::new(u32::MAX);
/// Holds and current step. Stays locked during the exit, so that no hold can begin any more.
static STATE: Mutex<State> = Mutex::new(State {
    holds: 0,
    held: false,
    doing: String::new(),
    undo: None,
});

struct State {
    holds: usize,
    /// Whether an earlier hold has ended.
    held: bool,
    doing: String,
    undo: Option<Box<dyn FnOnce() + Send>>,
}

/// Starts to handle signals.
///
/// # Errors
/// If the signal handlers cannot be installed.
pub fn listen() -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build()?;
    let (mut interrupt, mut terminate) = {
        let _entered = runtime.enter();
        (
            signal(SignalKind::interrupt())?,
            signal(SignalKind::terminate())?,
        )
    };
    std::thread::spawn(move || {
        runtime.block_on(async {
            loop {
                tokio::select! {
                    _ = interrupt.recv() => {}
                    _ = terminate.recv() => {}
                }
                ask();
            }
        });
    });
    Ok(())
}

/// Returns whether a signal has asked the command to end.
pub fn is_asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Sets the progress of the work, from 0 to 1.
pub fn far(fraction: f64) {
    PERCENT.store((100.0 * fraction) as u32, Ordering::Relaxed);
}

/// Sets the current step of the work.
pub fn doing(what: &str) {
    what.clone_into(&mut state().doing);
}

/// Guard that defers signals: while it exists, the first one is only noted.
#[derive(Debug)]
pub struct Hold(());

/// Starts a section that must be completed.
pub fn hold() -> Hold {
    state().holds += 1;
    Hold(())
}

impl Drop for Hold {
    fn drop(&mut self) {
        let mut state = state();
        state.holds -= 1;
        state.held = true;
    }
}

/// Guard that removes the written files unless they are kept.
#[derive(Debug)]
pub struct Undo(());

/// Runs `take_away` when the returned guard is dropped, or when a signal terminates the program before. There is one
/// guard at a time.
pub fn undo(take_away: impl FnOnce() + Send + 'static) -> Undo {
    state().undo = Some(Box::new(take_away));
    Undo(())
}

/// Keeps the files: all are written.
pub fn keep(undo: Undo) {
    state().undo = None;
    drop(undo);
}

impl Drop for Undo {
    fn drop(&mut self) {
        let take_away = state().undo.take();
        if let Some(take_away) = take_away {
            take_away();
        }
    }
}

fn ask() {
    let again = ASKED.swap(true, Ordering::Relaxed);
    // The lock is kept until the exit: a thread that asks for a hold now waits for the end.
    let mut state = state();
    if state.holds > 0 && !again {
        return;
    }
    let _leaving = whole_file::remove_unfinished_and_leave();
    let percent = PERCENT.load(Ordering::Relaxed);
    let mut far = String::new();
    if percent <= 100 {
        far += &format!(" at {percent} %");
    }
    if !state.doing.is_empty() {
        far += &format!(" ({})", state.doing);
    }
    let left = if let Some(take_away) = state.undo.take() {
        take_away();
        "; what was written is removed"
    } else if state.holds > 0 || state.held {
        "; existing files are complete, unfinished ones are removed"
    } else {
        "; no result was written"
    };
    eprintln!("interrupted{far}{left}");
    std::process::exit(EXIT_CODE);
}

/// Locks the state. A panic in another thread does not matter, because every change of the state is a single step.
fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}
