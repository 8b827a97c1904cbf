//! Tuning of the detectors after Salt Ducaju et al. on labelled recordings, and its trade-off curves.

mod class;

use tauscope_bus::TwinState;

use crate::frame::{
    ContactKind, FoundSweep, Impedance, LabelledContact, LearnError, Lesson, Lessons,
    MATCH_BEFORE_NS, Setup, ThresholdSweep, rate,
};
use crate::salt_ducaju::contact_machine::{Machine, MachineSettings, NewContact, Rule};
use crate::salt_ducaju::contact_signals::{Instant, SignalSettings, Signals};

pub(crate) use class::{best, sweep_class};

/// Duration of the arm's oscillation after a contact \[ns\].
/// Tuned: on the training recordings of the practice set of assembly (docs/papers.md); not swept.
const SWINGS_NS: i64 = 300_000_000;
/// Ratio of the threshold to the largest norm in contact-free motion.
/// Chosen: with 1, a slightly harder motion than the hardest recorded one gives a false alarm. The force that is
/// missed grows in proportion to it.
const MARGIN: f64 = 1.1;
/// Number of thresholds in a sweep, in equal ratios.
/// Tuned: for the picture alone.
const STEPS: usize = 41;
/// First and last threshold of a sweep, relative to the tuned one.
/// Tuned: for the picture alone.
const SHARES: [f64; 2] = [0.25, 4.0];

/// Signals and labels of a recording.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    pub instants: Vec<Instant>,
    pub contacts: Vec<LabelledContact>,
}

/// Data for the tuning.
#[derive(Debug, Clone)]
pub(crate) struct Tracks {
    pub train: Vec<Track>,
    pub validation: Vec<Track>,
    /// Sample rate \[Hz\].
    rate_hz: Option<f64>,
    impedance: Option<Impedance>,
    /// Length of the sliding window, during which it still contains a past contact \[ns\].
    window_ns: i64,
}

impl Tracks {
    fn all(&self) -> impl Iterator<Item = &Track> {
        self.train.iter().chain(&self.validation)
    }

    /// Returns the settings with the rate and impedance of the tuning.
    pub fn tuned(&self, settings: &SignalSettings) -> SignalSettings {
        SignalSettings {
            tuned_rate_hz: self.rate_hz,
            tuned_impedance: self.impedance,
            ..*settings
        }
    }
}

/// Computes the signals of the recordings.
pub(crate) fn tracks(
    settings: &SignalSettings,
    setup: &Setup,
    lessons: &Lessons<'_>,
    detector: &'static str,
) -> Result<Tracks, LearnError> {
    let signals = Signals::new(settings, setup, detector)?;
    let unlabelled = |missing: &str| LearnError::NoLabels {
        detector,
        missing: missing.to_owned(),
    };
    let lacking = lessons
        .train
        .iter()
        .filter(|lesson| lesson.contacts.is_none());
    let lacking: Vec<&str> = lacking.map(|lesson| lesson.name.as_str()).collect();
    if !lacking.is_empty() {
        let names = lacking.join(", ");
        return Err(unlabelled(&format!(
            "the training recordings {names} have no labels"
        )));
    }
    let mut fault = None;
    let mut run = |lesson: &Lesson| {
        let mut signals = signals.clone();
        let seen = |sample: &TwinState| signals.update(sample);
        let instants = lesson.samples.iter().filter_map(seen).collect();
        fault = fault.or(signals.fault());
        let contacts = lesson.contacts.clone().unwrap_or_default();
        Track { instants, contacts }
    };
    let train: Vec<Track> = lessons.train.iter().map(&mut run).collect();
    let labelled = lessons
        .validation
        .iter()
        .filter(|lesson| lesson.contacts.is_some());
    let validation: Vec<Track> = labelled.map(&mut run).collect();
    if let Some(fault) = fault {
        return Err(LearnError::Failed {
            detector,
            reason: fault.to_string(),
        });
    }
    let kinds = |kind| {
        let mut contacts = train.iter().flat_map(|track| &track.contacts);
        contacts.any(|contact| contact.kind == kind && !contact.ignore)
    };
    if !kinds(ContactKind::Collision) || !kinds(ContactKind::Cooperation) {
        return Err(unlabelled(
            "those of the training recordings do not name both collisions and cooperations",
        ));
    }
    let period_ns = train.iter().chain(&validation).find_map(|track| {
        let (first, last) = (track.instants.first()?, track.instants.last()?);
        let steps = track.instants.len() as i64 - 1;
        (steps > 0).then(|| (last.stamp_ns - first.stamp_ns) / steps)
    });
    Ok(Tracks {
        impedance: setup.impedance,
        train,
        validation,
        rate_hz: rate::of(&[lessons.train, lessons.validation]),
        window_ns: period_ns.unwrap_or_default() * settings.window as i64,
    })
}

/// Returns `F_th`: [`MARGIN`] times the largest norm without contact, so that there are no false alarms. A contact
/// missed at this threshold could not be detected without false alarms.
pub(crate) fn force_threshold(tracks: &Tracks, detector: &'static str) -> Result<f64, LearnError> {
    let rest_ns = tracks.window_ns + SWINGS_NS;
    let free = tracks.all().flat_map(|track| {
        let touched = |stamp_ns: i64| {
            let mut contacts = track.contacts.iter();
            contacts.any(|c| (c.on_ns - MATCH_BEFORE_NS..=c.off_ns + rest_ns).contains(&stamp_ns))
        };
        track
            .instants
            .iter()
            .filter(move |instant| !touched(instant.stamp_ns))
    });
    let largest = free.map(Instant::largest_norm_n).reduce(f64::max);
    largest
        .map(|largest| MARGIN * largest)
        .ok_or_else(|| LearnError::TooLittle {
            detector,
            wanted: "a window of contact-free motion".to_owned(),
            found: "none".to_owned(),
        })
}

/// Records the contacts that a rule classifies.
struct Asked<'a> {
    rule: &'a mut dyn Rule,
    contact: Option<NewContact>,
}

impl Rule for Asked<'_> {
    fn classify(&mut self, contact: &NewContact) -> ContactKind {
        self.contact = Some(*contact);
        self.rule.classify(contact)
    }
}

/// Returns the detections of a machine in a recording: stamp and contact.
fn detections(
    track: &Track,
    settings: &MachineSettings,
    window: usize,
    rule: &mut dyn Rule,
) -> Vec<(i64, NewContact)> {
    let mut machine = Machine::new(settings, window);
    let mut asked = Asked {
        rule,
        contact: None,
    };
    let mut all = Vec::new();
    for instant in &track.instants {
        machine.step(instant, &mut asked);
        if let Some(contact) = asked.contact.take() {
            all.push((instant.stamp_ns, contact));
        }
    }
    all
}

/// Returns the index of the labelled contact to which a detection at `stamp_ns` belongs.
fn owner(contacts: &[LabelledContact], stamp_ns: i64) -> Option<usize> {
    let mut latest: Option<usize> = None;
    for (i, contact) in contacts
        .iter()
        .enumerate()
        .filter(|(_, contact)| contact.matches(stamp_ns))
    {
        if latest.is_none_or(|latest| contact.on_ns >= contacts[latest].on_ns) {
            latest = Some(i);
        }
    }
    latest
}

/// Returns whether a contact is a collision during or right after a cooperation, which Algorithm 1 does not detect.
fn is_covered(contacts: &[LabelledContact], at: usize) -> bool {
    let contact = &contacts[at];
    let covers = |other: &LabelledContact| {
        other.kind == ContactKind::Cooperation
            && (other.on_ns..=other.off_ns + SWINGS_NS).contains(&contact.on_ns)
    };
    contact.kind == ContactKind::Collision && contacts.iter().any(covers)
}

/// A detected labelled contact.
pub(crate) struct Found<'a> {
    pub kind: ContactKind,
    pub contact: NewContact,
    /// Instants from the detection on.
    instants: &'a [Instant],
}

impl Found<'_> {
    /// Returns the largest norm up to `for_ns` after the detection.
    pub fn largest_norm_n(&self, for_ns: i64) -> f64 {
        let end_ns = self
            .instants
            .first()
            .map_or(0, |first| first.stamp_ns + for_ns);
        let until = self
            .instants
            .iter()
            .take_while(|instant| instant.stamp_ns <= end_ns);
        until.map(Instant::largest_norm_n).fold(0.0, f64::max)
    }
}

/// Returns the detected labelled contacts of the training recordings: the first detection of each.
pub(crate) fn found<'a>(
    tracks: &'a Tracks,
    settings: &MachineSettings,
    window: usize,
    rule: &mut dyn Rule,
    detector: &'static str,
) -> Result<Vec<Found<'a>>, LearnError> {
    let mut all = Vec::new();
    for track in &tracks.train {
        let mut seen = vec![false; track.contacts.len()];
        for (stamp_ns, contact) in detections(track, settings, window, rule) {
            let Some(at) = owner(&track.contacts, stamp_ns) else {
                continue;
            };
            let first = !std::mem::replace(&mut seen[at], true);
            let label = &track.contacts[at];
            if first
                && !label.ignore
                && label.kind != ContactKind::Contact
                && !is_covered(&track.contacts, at)
            {
                let at = track
                    .instants
                    .partition_point(|instant| instant.stamp_ns < stamp_ns);
                all.push(Found {
                    kind: label.kind,
                    contact,
                    instants: &track.instants[at..],
                });
            }
        }
    }
    for (kind, name) in [
        (ContactKind::Collision, "collision"),
        (ContactKind::Cooperation, "cooperation"),
    ] {
        if !all.iter().any(|found| found.kind == kind) {
            return Err(LearnError::TooLittle {
                detector,
                wanted: format!("one {name} that stands out from contact-free motion"),
                found: "none".to_owned(),
            });
        }
    }
    Ok(all)
}

/// Returns detections and delays for thresholds around that of `settings`.
pub(crate) fn sweep_threshold(
    tracks: &Tracks,
    settings: &MachineSettings,
    window: usize,
    rule: &mut dyn Rule,
) -> Vec<ThresholdSweep> {
    let ratio = SHARES[1] / SHARES[0];
    let share = |step: usize| SHARES[0] * ratio.powf(step as f64 / (STEPS - 1) as f64);
    let steps = (0..STEPS).map(|step| {
        let force_threshold_n = settings.force_threshold_n * share(step);
        let settings = MachineSettings {
            force_threshold_n,
            ..*settings
        };
        let mut sweep = ThresholdSweep {
            force_threshold_n,
            collisions: FoundSweep::default(),
            cooperations: FoundSweep::default(),
            false_alarms: 0,
        };
        for track in tracks.all() {
            let mut first: Vec<Option<i64>> = vec![None; track.contacts.len()];
            for (stamp_ns, _) in detections(track, &settings, window, rule) {
                let swings =
                    |c: &LabelledContact| (c.on_ns..=c.off_ns + SWINGS_NS).contains(&stamp_ns);
                match owner(&track.contacts, stamp_ns) {
                    Some(at) => first[at] = first[at].or(Some(stamp_ns)),
                    None if track.contacts.iter().any(swings) => {}
                    None => sweep.false_alarms += 1,
                }
            }
            for (at, (label, first)) in track.contacts.iter().zip(first).enumerate() {
                if label.ignore || is_covered(&track.contacts, at) {
                    continue;
                }
                let of = match label.kind {
                    ContactKind::Cooperation => &mut sweep.cooperations,
                    ContactKind::Collision | ContactKind::Contact => &mut sweep.collisions,
                };
                match first {
                    None => of.missed += 1,
                    Some(stamp_ns) => {
                        of.found += 1;
                        of.mean_delay_s += (stamp_ns - label.on_ns) as f64 * 1e-9;
                    }
                }
            }
        }
        for of in [&mut sweep.collisions, &mut sweep.cooperations] {
            of.mean_delay_s /= of.found as f64;
        }
        sweep
    });
    steps.collect()
}
