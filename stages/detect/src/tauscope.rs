//! `tauscope`: compares the residual with its contact-free baseline.
//!
//! The noise of a residual depends on the joint, on its speed and on the averaging time. Friction is least certain
//! where a joint reverses, and the errors of different joints are correlated. A residual that is small compared with
//! the noise of one sample can be large compared with the noise of a mean over thirty. All of this is learnt from
//! contact-free recordings ([`Learnt`]). The friction that the twin leaves out and the lag of the twin are learnt
//! first and subtracted ([`LearntUsual`]). Inertial effort that the change of velocity explains, and the twin's
//! low-passed acceleration shows only later, does not count as a contact.
//!
//! The score is computed from the mean residual over windows of 10 ms to 0.2 s. For each window, the squared
//! Mahalanobis length of the mean is divided by the value that one of a thousand contact-free samples exceeds. The
//! score is the largest of these ratios. Slow drift (warming up) is followed while nothing touches the robot.
//!
//! The threshold follows from the tolerated number of false alarms per hour. The rate at which chance exceeds a score
//! is extrapolated from the score's peaks in contact-free data ([`Tail`]). This estimate improves while the detector
//! runs (`going_on`).
//!
//! If the labels distinguish collisions from cooperations, a linear discriminant between them is learnt, too
//! ([`Kinds`]).
//!
//! A contact with a stationary arm is over once most of it has vanished and the remaining residual is steady: static
//! friction may hold the remaining residual.
//!
//! The touched link is the one whose force explains the whitened residual best. The point of contact is searched
//! along the link (Haddadin, De Luca and Albu-Schäffer, "Robot Collisions: A Survey on Detection, Isolation, and
//! Identification", 2017, sections V and VI).
//!
//! The last sentences of a constant's doc comment say where its value comes from. `Physical:` names a source,
//! `Statistical:` and `Derived:` a derivation, `Chosen:` a reason, `Resolution:` a limit of accuracy or computing
//! time, and `Tuned:` the data. Constants tuned "on the sets named in `tauscope`" were chosen with
//! simulated sets in view. These sets were drawn by `tests/contacts/assembly.py` and `tests/contacts/paths.py` with
//! the seeds 301 to 323, 401 to 406, 432 to 434, 451 to 456 and 501 to 508, and judged by
//! `tauscope evaluate set.yaml --out results --detectors tauscope`. The sensitivity of the results to these constants
//! was not measured then.

mod alarm;
mod going_on;
mod kinds;
mod late;
mod learning;
mod learnt;
mod means;
mod noise;
mod pieces;
mod place;
mod points;
mod recovery;
mod rest;
mod ring;
mod smallest;
mod spans;
mod stand;
mod sums;
mod tail;
mod usual;
mod windows;

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use tauscope_bus::{TwinState, flags};

use crate::frame::rate::Rate;
use crate::frame::{
    ConfigError, Detector, DetectorSettings, HereOrFile, Judgement, LearnError, Lessons, Setup,
    State, Task, Trained, Training, Verdict,
};
use alarm::Watch;
use going_on::GoingOn;
use late::{Late, LateIn};
use learnt::ENOUGH_S;
pub use learnt::{KindContacts, Kinds, Learnt, LearntJoint, LearntRest, LearntWindow, Smallest};
use nalgebra::Vector6;
use place::Place;
use ring::Ring;
use spans::Follow;
pub use tail::Tail;
pub use usual::LearntUsual;
use windows::Windows;

/// Canonical name.
pub(crate) const NAME: &str = "tauscope";

/// State of a contact that is not classified.
const UNTOLD: &str = "contact";
/// Time by which a contact precedes its threshold crossing; the rise of the residual is measured from there \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const FELT_NS: i64 = 3_000_000;
/// Window before the threshold crossing over which the joint velocities are averaged, as (start, end) \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), with kinds reported; not swept.
const MOVED_NS: [i64; 2] = [28_000_000, 7_000_000];
/// Number of samples for which the joint velocities are kept.
/// Physical: holds the 28 ms of [`MOVED_NS`] up to 4.5 kHz; arms are read at 1 kHz and less.
const MOVED: usize = 128;
/// Score above which a residual is not treated as drift: one of a thousand contact-free samples exceeds it.
/// Statistical: the unit of the score.
const DRIFT: f64 = 1.0;

/// Settings of `tauscope`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Tolerated false alarms per hour, from which the threshold follows (one a week: 0.006).
    #[schemars(range(min = 1e-6, max = 3600.0))]
    pub false_alarms_per_hour: f64,
    /// Time constant with which slow drift of the residual is followed \[s\].
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub drift_s: f64,
    /// Duration after each start over which the mean residual is taken as an offset \[s\]. Nothing may touch the
    /// robot during this time. 0 turns it off.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub offset_from_first_s: f64,
    /// State learnt from contact-free recordings, or the file that holds it: `learnt.yaml` as `tauscope init` and
    /// `tauscope evaluate` write it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<HereOrFile<Learnt>>,
    /// Whether the detector continues to learn while it runs. Its threshold can fall as it sees more contact-free
    /// time.
    pub keep_learning: bool,
    /// File that keeps what the detector learns while it runs from one run to the next. It need not exist yet. It
    /// takes precedence over `learnt`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<PathBuf>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            false_alarms_per_hour: 5.0,
            drift_s: 20.0,
            offset_from_first_s: 0.0,
            learnt: None,
            keep_learning: true,
            state: None,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "The project's own detector: compares the residual with its contact-free baseline.";
    const TRAINING: Training = Training::Own;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let Some(learnt) = self.learnt() else {
            return Err(ConfigError::NotLearnt { detector: NAME });
        };
        if let Some(reason) = learnt.fault(&setup.joint_names) {
            return Err(ConfigError::LearntState {
                detector: NAME,
                reason,
            });
        }
        let tells_kinds = learnt.kinds.is_some();
        Ok(Box::new(Tauscope::new(learnt, self, setup, tells_kinds)))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        let mut settings = self.clone();
        if settings.offset_from_first_s <= 0.0 {
            settings.offset_from_first_s = task.free_first_s;
        }
        Ok((learn(&settings, task.setup, &task.lessons)?, None))
    }

    fn warning(&self, _: &Setup) -> Option<String> {
        let free_s = self.learnt()?.free_s?;
        (free_s < ENOUGH_S).then(|| {
            format!(
                "{NAME} has learnt from {free_s:.1} s without contacts, which is too little: its threshold is a guess, and its rate of false alarms is not known; let it learn from at least {ENOUGH_S} s, better some minutes"
            )
        })
    }

    fn note(&self) -> Option<String> {
        self.learnt()?.kind_contacts.as_ref()?.note()
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        let state = self.state.iter().map(|_| "state");
        state.chain(self.learnt.iter().map(|_| "learnt")).collect()
    }

    fn state_file(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(&mut self.state)
    }

    fn state_schema(generator: &mut SchemaGenerator) -> Option<Schema> {
        Some(generator.subschema_for::<Learnt>())
    }

    fn learnt_file(&self) -> Option<&Path> {
        self.learnt.as_ref()?.file()
    }

    fn resume(&mut self, state: State) -> Result<(), serde_json::Error> {
        self.learnt = Some(HereOrFile::Here(serde_json::from_value(state)?));
        Ok(())
    }
}

/// Learns the baseline from the contact-free stretches of all recordings, and the discriminant between the kinds from
/// the contacts of the training recordings.
///
/// # Errors
/// If the recordings hold too few contact-free samples.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Settings, LearnError> {
    let late = LateIn::of(lessons, setup);
    let mut learnt = Learnt::new(lessons, &late, &setup.joint_names, settings.follow())?;
    learnt.smallest = smallest::smallest(&learnt, lessons, &late, setup, settings.follow());
    (learnt.kinds, learnt.kind_contacts) = kinds::learn(&learnt, settings, setup, lessons).unzip();
    Ok(Settings {
        learnt: Some(HereOrFile::Here(learnt)),
        ..settings.clone()
    })
}

impl Settings {
    /// Returns the state learnt from contact-free recordings, once it has been read.
    pub fn learnt(&self) -> Option<&Learnt> {
        self.learnt.as_ref()?.here()
    }

    fn follow(&self) -> Follow {
        Follow {
            drift_s: self.drift_s,
            offset_from_first_s: self.offset_from_first_s,
        }
    }

    /// Returns, by link, the smallest force that is found at `false_alarms_per_hour`; empty before anything is
    /// learnt.
    pub fn smallest_forces(&self, false_alarms_per_hour: f64) -> Vec<Smallest> {
        let Some(learnt) = self.learnt() else {
            return Vec::new();
        };
        let factor = learnt.tail.threshold(false_alarms_per_hour).sqrt();
        let at = |of: &Smallest| Smallest {
            link: of.link.clone(),
            half_n: of.half_n.map(|force| force * factor),
            most_n: of.most_n.map(|force| force * factor),
        };
        learnt.smallest.iter().map(at).collect()
    }
}

struct Tauscope {
    rate: Rate,
    late: Late,
    windows: Windows,
    /// Recent joint velocities \[rad/s\].
    moved: Ring<MOVED>,
    place: Place,
    watch: Watch,
    /// Threshold estimate from further contact-free time; `None` if the detector does not continue to learn.
    going_on: Option<GoingOn>,
    kinds: Option<Kinds>,
    /// Measurements from which the newest alarm was classified, and (`state`) the result.
    measurements: Option<Vector6<f64>>,
    state: &'static str,
}

impl Detector for Tauscope {
    fn name(&self) -> &'static str {
        NAME
    }

    fn threshold(&self) -> Option<f64> {
        Some(self.watch.threshold())
    }

    fn fault(&self) -> Option<String> {
        self.rate.fault()
    }

    fn learnt(&self) -> Option<State> {
        let going_on = self.going_on.as_ref()?;
        let mut learnt = self.windows.learnt();
        learnt.peaks_since = going_on.peaks();
        serde_json::to_value(learnt).ok()
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        self.rate.update(sample);
        if sample.header.has(flags::RESET) {
            self.windows.reset();
            self.moved.reset();
            self.watch.reset();
        }
        let free = self.watch.contact_ns().is_none();
        // A residual may be drift if it raises no alarm and is not far from the baseline.
        let drifts = free.then_some(self.watch.threshold().min(DRIFT));
        let late = self.late.next(sample);
        let score = self.windows.score(sample, &late, drifts);
        self.moved.push(sample.header.stamp_ns, &sample.velocity);
        let ready = self.windows.ready() && self.rate.is_right() && sample.header.has(flags::READY);
        if !ready {
            self.watch.end();
            return Judgement {
                score,
                ready,
                verdict: None,
            };
        }
        let now_ns = sample.header.stamp_ns;
        if self.windows.settle(sample, free) {
            self.watch.end();
        } else if let Some(since_ns) = self.watch.step(now_ns, score, &mut self.windows) {
            self.tell(sample, since_ns);
        }
        self.go_on(sample, score);
        let threshold = self.watch.threshold();
        let contact = (self.watch.contact_ns())
            .map(|contact_ns| (self.place).see(sample, &self.windows, contact_ns, threshold));
        Judgement {
            score,
            ready,
            verdict: Some(Verdict {
                state: contact.map_or("free", |_| self.state),
                contact,
            }),
        }
    }
}

impl Tauscope {
    /// Creates a detector. With `tells_kinds` it delays its alarms until the contact can be classified.
    fn new(learnt: &Learnt, settings: &Settings, setup: &Setup, tells_kinds: bool) -> Self {
        let per_hour = settings.false_alarms_per_hour;
        let mut going_on = (settings.keep_learning).then(|| GoingOn::new(learnt, per_hour));
        let threshold =
            (going_on.as_mut()).map_or_else(|| learnt.tail.threshold(per_hour), GoingOn::threshold);
        let mut windows = Windows::new(learnt, settings.follow());
        windows.seek(threshold, per_hour);
        Self {
            rate: Rate::new(Settings::NAME, setup, learnt.rate_hz),
            late: Late::new(setup),
            windows,
            moved: Ring::new(),
            place: Place::new(setup),
            watch: Watch::new(threshold, tells_kinds),
            going_on,
            kinds: learnt.kinds,
            measurements: None,
            state: UNTOLD,
        }
    }

    /// Continues to learn the threshold from a score.
    fn go_on(&mut self, sample: &TwinState, score: f64) {
        let Some(going_on) = &mut self.going_on else {
            return;
        };
        let alarm = (self.watch.contact_ns()).map(|_| self.watch.threshold());
        going_on.add(sample, self.windows.joints(), score, alarm);
        if alarm.is_none() && going_on.is_due() {
            let threshold = going_on.threshold();
            self.watch.retune(threshold);
            self.windows.retune(threshold);
        }
    }

    /// Classifies a contact as its alarm is raised, which has been pending since `since_ns`.
    fn tell(&mut self, sample: &TwinState, since_ns: i64) {
        self.place.begin();
        let [from_ns, to_ns] = MOVED_NS.map(|before_ns| since_ns - before_ns);
        let velocity = self.moved.mean(from_ns, to_ns);
        let rise = self.windows.rise(since_ns - FELT_NS);
        let touch = (self.place).on_tool(sample, &self.windows, &rise, &velocity);
        self.measurements = touch.as_ref().map(kinds::measurements);
        let told = self.kinds.as_ref().zip(self.measurements.as_ref());
        self.state = told.map_or(UNTOLD, |(kinds, seen)| kinds::classify(kinds, seen));
    }
}
