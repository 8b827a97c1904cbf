//! What the twin misses of the arm's inertia because its acceleration comes late.
//!
//! An acceleration has to be low-passed, so the twin knows of a move only when it has been going on for a while: where an arm sets off or stops, the residual
//! holds its inertia times what the acceleration lacks. The change of velocity tells that at once (as in a momentum observer: Haddadin, De Luca and
//! Albu-Schäffer 2017, section III-D), but brings noise along.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use crate::frame::momentum::Inertia;
use crate::frame::{Lesson, Lessons, Setup, Tap};

/// What the twin misses, by joint; NaN where that is not known. No allocation per sample.
#[derive(Debug)]
pub(crate) struct Late {
    inertia: Option<Tap<Inertia>>,
    /// By joint \[effort unit per N m\].
    effort_per_nm: JointArray,
}

impl Late {
    /// Of the robot of `setup`.
    pub fn new(setup: &Setup) -> Self {
        let mut effort_per_nm = [f64::NAN; MAX_JOINTS];
        for (per_nm, joint) in effort_per_nm.iter_mut().zip(&setup.joints) {
            if joint.tells_torque() {
                *per_nm = joint.effort_per_nm;
            }
        }
        Self {
            inertia: Inertia::of(setup),
            effort_per_nm,
        }
    }

    /// Mean over the step to the next sample of M times what the twin's acceleration lacks \[effort unit\].
    pub fn next(&mut self, sample: &TwinState) -> JointArray {
        let Some(inertia) = &mut self.inertia else {
            return [f64::NAN; MAX_JOINTS];
        };
        let mut late = inertia.with(|inertia| inertia.update(sample));
        for (late, per_nm) in late.iter_mut().zip(&self.effort_per_nm) {
            *late *= per_nm;
        }
        late
    }
}

/// The same of all samples of recordings.
#[derive(Debug)]
pub(crate) struct LateIn {
    train: Vec<Vec<JointArray>>,
    validation: Vec<Vec<JointArray>>,
}

impl LateIn {
    pub fn of(lessons: &Lessons<'_>, setup: &Setup) -> Self {
        // These are other samples than those that others share.
        let own = Setup {
            shared: None,
            ..setup.clone()
        };
        let of = |lesson: &Lesson| {
            let mut late = Late::new(&own);
            let samples = lesson.samples.iter();
            samples.map(|sample| late.next(sample)).collect()
        };
        Self {
            train: lessons.train.iter().map(of).collect(),
            validation: lessons.validation.iter().map(of).collect(),
        }
    }

    /// By recording, the training ones first.
    pub fn recordings(&self) -> impl Iterator<Item = &[JointArray]> {
        let all = self.train.iter().chain(&self.validation);
        all.map(Vec::as_slice)
    }
}
