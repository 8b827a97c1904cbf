//! The search where no joint moves: what comes and goes can be told, what lasts cannot.

use tauscope_dynamics::terms::TermError;

use crate::active::Hypothesis;
use crate::explain::{Judged, Setup};
use crate::findings;
use crate::fit::Fit;
use crate::recording::Recording;
use crate::search::Search;
use crate::track::Track;
use crate::windows::{TimeKind, time_kind};

/// What the arm bears at the beginning of a recording is what it bears without anything that comes and goes \[s\].
const BEGINNING_S: f64 = 1.0;

/// Shifts what the twin says of an arm at rest so that it begins with what is measured: load, friction and offset cannot be told
/// apart there.
pub fn start_at_measured(track: &mut Track, recording: &Recording, unit_nm: &[f64]) {
    let n = unit_nm.len();
    let samples = track.time_s.partition_point(|t| *t < BEGINNING_S);
    if recording.effort.is_empty() || samples == 0 {
        return;
    }
    for (j, unit) in unit_nm.iter().enumerate() {
        let off = |k: usize| recording.effort[k * n + j] * unit - track.rigid[k * n + j];
        let mean = (0..samples).map(off).sum::<f64>() / samples as f64;
        for value in track.rigid.iter_mut().skip(j).step_by(n) {
            *value += mean;
        }
    }
}

impl Setup<'_> {
    /// Searches each recording by itself for what comes and goes in it; the reason why nothing can be said, if there is one.
    pub fn at_rest(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, String>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let rests_count = vec![true; joints.len()];
        let mut hypotheses = self.hypotheses();
        let passes = |h: &Hypothesis| time_kind(*h) == TimeKind::Once;
        hypotheses.retain(passes);
        let say = |text: &str| progress(0.1, text);
        let (mut actives, mut undetectable) = (Vec::new(), Vec::new());
        let mut named = findings::Named::default();
        for recording in &input.fit {
            let problem = self.problem(std::slice::from_ref(recording), &rests_count)?;
            let search = Search {
                problem: &problem,
                hypotheses: &hypotheses,
                say: &say,
            };
            let found = search.run(Vec::new(), Vec::new());
            let before = Fit::new(&problem, Vec::new());
            named.extend(findings::of(&search, &found, &before, input, &joints));
            if undetectable.is_empty() {
                undetectable = findings::undetectable(&search, &found, &joints);
            }
            actives.extend(found.fit.actives);
        }
        if named.findings.is_empty() {
            return Ok(Err(
                "no joint moves for as long as a second: standstill does not tell friction from load".to_owned(),
            ));
        }
        named.notes.push(format!(
            "No joint moves: what lasts cannot be told from the load at rest, and what the arm bears in the first {BEGINNING_S} s of \
             each recording is taken for what it always bears there."
        ));
        if self.is_unscaled() {
            named.notes.push(
                "Nobody knows the drives' scales: forces are as if each joint had 1 N m/A."
                    .to_owned(),
            );
        }
        let problem = self.problem(&input.fit, &rests_count)?;
        Ok(Ok(Judged {
            before: Fit::new(&problem, Vec::new()),
            found: Fit::new(&problem, actives),
            named,
            undetectable,
            rests_count,
            problem,
        }))
    }
}
