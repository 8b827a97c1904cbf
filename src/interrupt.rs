//! Ctrl-C and SIGTERM, for every command that is one piece of work. (`run` ends its stages in order itself.)
//!
//! A command that computes, and writes at its end, is ended where it is: a thread waits for the signal, removes what
//! is unfinished, says how far it got, and leaves with exit code 1. A command that has something to bring to its end,
//! or that writes right now, takes a [`Hold`]: then the signal is only noted, the command asks for it ([`is_asked`])
//! between its steps and says itself how far it got. A second signal ends it in any case.
//!
//! A command whose files are of use only together has an [`Undo`]: what it has written is taken away again where the
//! command fails, and where a signal ends it.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tauscope_archive::whole_file;
use tokio::signal::unix::{SignalKind, signal};

/// Exit code of work that was not brought to its end.
const EXIT_CODE: i32 = 1;

/// Somebody has asked.
static ASKED: AtomicBool = AtomicBool::new(false);
/// How far the work is, in percent; more than 100 where nobody knows.
static PERCENT: AtomicU32 = AtomicU32::new(u32::MAX);
/// Who holds, and what is being done. Locked while the program leaves, so that nothing begins then.
static STATE: Mutex<State> = Mutex::new(State {
    holds: 0,
    held: false,
    doing: String::new(),
    undo: None,
});

struct State {
    holds: usize,
    /// Somebody has brought something to its end before.
    held: bool,
    doing: String,
    undo: Option<Box<dyn FnOnce() + Send>>,
}

/// From now on signals end the program in order.
///
/// # Errors
/// If they cannot be listened to.
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

/// Whether the work is to end.
pub fn is_asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// The work has come to `fraction`, from 0 to 1.
pub fn far(fraction: f64) {
    PERCENT.store((100.0 * fraction) as u32, Ordering::Relaxed);
}

/// The work goes on with this.
pub fn doing(what: &str) {
    what.clone_into(&mut state().doing);
}

/// While there is one, a signal is only noted.
#[derive(Debug)]
pub struct Hold(());

/// What follows must be brought to an end.
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

/// Takes away what was written, unless it is kept.
#[derive(Debug)]
pub struct Undo(());

/// `take_away` runs if the result is dropped, and if a signal ends the program before. There is one at a time.
pub fn undo(take_away: impl FnOnce() + Send + 'static) -> Undo {
    state().undo = Some(Box::new(take_away));
    Undo(())
}

/// All is written, and stays.
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
    // Nothing else begins from here on: whoever wants to hold now waits for the end.
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
        "; what is there is whole, what was unfinished is removed"
    } else {
        "; no result was written"
    };
    eprintln!("interrupted{far}{left}");
    std::process::exit(EXIT_CODE);
}

/// Nothing in here can be left half done, so a panic elsewhere does not matter.
fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}
