//! Who hangs: a stage says ten times a second how it fares, whether or not samples come. One that does not any more is
//! named, and after a while its process is killed, so that it can begin again. Of stages of one thread their process
//! says which one it is stuck in; the others only wait for that one.

use std::time::Duration;

use tokio::time::Instant;

use super::Supervisor;
use super::local::Local;
use super::process::Process;

/// A stage that has said nothing for so long hangs.
/// Resolution: thirty reports are missing; a busy machine delays a few.
const HANGS_AFTER: Duration = Duration::from_secs(3);
/// A process with a stage that hangs for so long is killed.
/// Resolution: time for somebody who has stopped it to let it go on.
const KILLED_AFTER: Duration = Duration::from_secs(30);

impl Supervisor<'_> {
    pub(super) fn tell_who_hangs(&mut self, now: Instant) {
        for index in 0..self.stages.len() {
            let stage = &self.stages[index];
            let unheard_for = stage.unheard_for(now).unwrap_or_default();
            let (crew, name) = (stage.crew, stage.seat.stage.clone());
            let stuck = self.stuck_in(crew, stage.root);
            let only_waits = stuck.is_some_and(|stuck| stuck != name);
            let hangs = unheard_for >= HANGS_AFTER && !only_waits;
            let is_new = self.stages[index].note_hangs(hangs);
            let seconds = unheard_for.as_secs();
            if hangs && is_new {
                let left = KILLED_AFTER.saturating_sub(HANGS_AFTER).as_secs();
                let id = self.crews[crew].process().map_or(0, Process::id);
                self.view.warn(&format!(
                    "warning: stage `{name}` hangs: nothing was heard of it for {seconds} s; its process {id} is \
                     killed in {left} s"
                ));
            } else if is_new && self.stages[index].is_running() {
                self.view.note(&format!("note: stage `{name}` goes on"));
            }
            if unheard_for >= KILLED_AFTER {
                self.crews[crew].kill();
            }
        }
    }

    /// The stage that a thread is stuck in, if its process says so.
    fn stuck_in(&self, crew: usize, root: usize) -> Option<&str> {
        let mut tree = (self.stages.iter()).filter(|it| it.crew == crew && it.root == root);
        let stuck = tree.find(|stage| stage.is_stuck());
        stuck.map(|stage| stage.seat.stage.as_str())
    }

    /// Tells the service manager how the run fares.
    pub(super) fn tell_service(&mut self, now: Instant) {
        let is_there = |stage: &Local| stage.is_ready() || stage.is_over();
        let ready = self.stages.iter().all(is_there);
        let names = |which: fn(&Local) -> bool| {
            let which = self.stages.iter().filter(|stage| which(stage));
            let names: Vec<&str> = which.map(|stage| stage.seat.stage.as_str()).collect();
            names.join(", ")
        };
        let hang = names(Local::hangs);
        let silent = names(|stage| stage.silence.trouble().is_some());
        let status = if self.stopping {
            "ending".to_owned()
        } else if !hang.is_empty() {
            format!("hang: {hang}")
        } else if !silent.is_empty() {
            format!("without data: {silent}")
        } else if ready {
            format!("{} stages run", self.stages.len())
        } else {
            "starting".to_owned()
        };
        self.service.tell(ready, status, now);
    }
}
