//! `tauscope`: the residual held against what it usually is.
//!
//! The noise of a residual is not the same in every joint, at every speed and over every length of time:
//! friction is least certain where a joint turns round, joints err together, and what is small beside
//! one sample is large beside the mean of thirty. All of that is learnt from contact-free recordings
//! ([`Learnt`]). Friction that the twin leaves out, and how late the twin is, are learnt first, and taken away ([`LearntUsual`]).
//! What the change of velocity explains at once, and the twin's low-passed acceleration later, is no contact. The score is the largest, over windows of 10 ms to 0.2 s, of the Mahalanobis length of the mean residual, in
//! units of what that window's length reaches at most in one of a thousand contact-free samples. Slow drift (warming up)
//! is followed while nothing touches the robot.
//!
//! The threshold is set by a wish: so many false alarms an hour. How often the score exceeds what by chance is
//! extrapolated from its peaks in contact-free data ([`Tail`]), and known better the longer it runs (`going_on`).
//!
//! Where labels tell collisions from cooperations, what parts them is learnt, too ([`Kinds`]).
//!
//! With a standing arm, a contact is over where most of it has gone and the rest is steady: static friction may hold that.
//!
//! The touched link is the one whose force explains the whitened residual best, the point of contact
//! sought along the link (Haddadin, De Luca and Albu-Schäffer, "Robot Collisions: A Survey on Detection,
//! Isolation, and Identification", 2017, sections V and VI).
//!
//! Each constant says where its value comes from, in the last sentence of its doc comment: `Physical:` a source, `Statistical:` a
//! derivation, `Tuned:` on which data. Those tuned "on the sets named in `tauscope`" were chosen with simulated sets in view, drawn by
//! `tests/contacts/assembly.py` and `tests/contacts/paths.py` with the seeds 301 to 323, 401 to 406, 432 to 434, 451 to 456 and 501 to
//! 508, by `tauscope evaluate set.yaml --out results --detectors tauscope`. How flat their optimum is was not measured then.

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

/// A contact's kind where none is told.
const UNTOLD: &str = "contact";
/// A contact is felt so much before its alarm is on its way \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const FELT_NS: i64 = 3_000_000;
/// How the tool moved is told from so long before that to so long before it \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope), where kinds are told; not swept.
const MOVED_NS: [i64; 2] = [28_000_000, 7_000_000];
/// For so many samples it is kept how the joints moved.
/// Physical: holds the 28 ms of [`MOVED_NS`] up to 4.5 kHz; arms are read at 1 kHz and less.
const MOVED: usize = 128;
/// A score above this is not taken for drift: the unit, what one of a thousand contact-free samples exceeds.
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
    /// The mean residual of so many seconds after each start is taken for an offset, in which nothing may touch
    /// the robot \[s\]; 0 for none.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub offset_from_first_s: f64,
    /// What contact-free recordings have taught, or the file that holds it: `learnt.yaml` as `tauscope init` and
    /// `tauscope evaluate` write it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<HereOrFile<Learnt>>,
    /// Whether it goes on learning while it runs: the more contact-free time it has seen, the lower its threshold may be.
    pub keep_learning: bool,
    /// A file that keeps what it learns while it runs from one run to the next; it need not exist yet, and goes before
    /// `learnt`.
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
    const ABOUT: &'static str = "The residual held against what it usually is: our own.";
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

/// Learns from contact-free stretches of all recordings, and what parts the kinds from the training recordings' contacts.
///
/// # Errors
/// If they hold too little.
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
    /// What contact-free recordings have taught, once it has been read.
    pub fn learnt(&self) -> Option<&Learnt> {
        self.learnt.as_ref()?.here()
    }

    fn follow(&self) -> Follow {
        Follow {
            drift_s: self.drift_s,
            offset_from_first_s: self.offset_from_first_s,
        }
    }

    /// By link, the smallest force that is found at `false_alarms_per_hour`; empty before anything is learnt.
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
    /// How the joints have moved \[rad/s\].
    moved: Ring<MOVED>,
    place: Place,
    watch: Watch,
    /// What further contact-free time tells of the threshold; nothing where it is not to go on.
    going_on: Option<GoingOn>,
    kinds: Option<Kinds>,
    /// Of the newest alarm, what kinds are told by, and what was told.
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
        // Whatever raises no alarm and is not far from usual may be drift.
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
    /// One that takes its time to tell the kinds if `tells_kinds`.
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

    /// Goes on learning from a score.
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

    /// Tells what can be told of a contact as its alarm is raised, which has been on its way since then.
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
