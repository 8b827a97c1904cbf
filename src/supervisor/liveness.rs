//! Detection of hung stages. Each stage sends a heartbeat ten times per second, whether or not samples arrive. A
//! stage without heartbeats is reported; if it stays hung, its process is killed and restarted. Stages of one thread
//! stop together: their process reports which of them is hung, and the others wait for it.

use std::time::Duration;

use tokio::time::Instant;

use super::Supervisor;
use super::local::Local;
use super::process::Process;

/// Time without heartbeats after which a stage is treated as hung.
/// Resolution: thirty heartbeats are missing; a busy machine delays a few.
const HANGS_AFTER: Duration = Duration::from_secs(3);
/// Time without heartbeats of a stage after which its process is killed.
/// Resolution: time for a person who has suspended it to resume it.
const KILLED_AFTER: Duration = Duration::from_secs(30);

impl Supervisor<'_> {
    pub(super) fn tell_who_hangs(&mut self, now: Instant) {
        for index in 0..self.stages.len() {
            let stage = &self.stages[index];
            let unheard_for = stage.unheard_for(now).unwrap_or_default();
            let (worker, name) = (stage.worker, stage.seat.stage.clone());
            let only_waits = !stage.is_stuck() && self.is_stuck_elsewhere(worker);
            let hangs = unheard_for >= HANGS_AFTER && !only_waits;
            let is_new = self.stages[index].note_hangs(hangs);
            let seconds = unheard_for.as_secs();
            if hangs && is_new {
                let left = KILLED_AFTER.saturating_sub(HANGS_AFTER).as_secs();
                let id = self.workers[worker].process().map_or(0, Process::id);
                self.view.warn(&format!(
                    "warning: stage `{name}` hangs: nothing was heard of it for {seconds} s; its process {id} is \
                     killed in {left} s"
                ));
            } else if is_new && self.stages[index].is_running() {
                self.view
                    .note(&format!("note: stage `{name}` responds again"));
            }
            if unheard_for >= KILLED_AFTER {
                self.workers[worker].kill();
            }
        }
    }

    /// Returns whether a process reports a hung stage, for which others of its threads wait.
    fn is_stuck_elsewhere(&self, worker: usize) -> bool {
        let mut stages = self.stages.iter().filter(|it| it.worker == worker);
        stages.any(Local::is_stuck)
    }

    /// Reports the state of the run to the service manager.
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
