//! Performance figures of a detector over recordings.

use serde::Serialize;

use super::events::{Matched, Matching, duration_s, free_s, in_alarm};
use super::samples::{Labelled, flags};
use super::statistics::{Distribution, poisson_bound_95};
use crate::input::Request;
use crate::runner::{Output, Runner};

/// One recording's output against its labels.
#[derive(Debug, Clone)]
pub struct Scored<'a> {
    /// The detector's output.
    pub output: &'a Output,
    /// Its events matched to the labels.
    pub matching: Matching<'a>,
    /// Its scores with the label of each sample.
    pub samples: Labelled,
    /// Its scores with the label of each window, for a detector that judges windows.
    pub windows: Option<Labelled>,
    /// Whether the recording holds any event.
    pub eventful: bool,
    /// Length \[s\].
    pub duration_s: f64,
    /// Contact-free time \[s\].
    pub free_s: f64,
    /// Time in alarm outside contacts and time outside contacts, on a grid \[s\].
    pub in_alarm_s: (f64, f64),
}

impl<'a> Scored<'a> {
    /// Scores `output` of a detector that judges windows of `window` samples; `None` without labels.
    pub fn of(request: &'a Request, output: &'a Output, window: Option<usize>) -> Option<Self> {
        let mut recordings = request.recordings.iter();
        let recording = recordings.find(|recording| recording.name == output.recording)?;
        let truth = recording.truth.as_ref()?;
        let flags = flags(&output.t, truth);
        let mut samples = Labelled::default();
        samples.add(&output.scores, &flags);
        let windows = window.map(|length| {
            let mut windows = Labelled::default();
            windows.add_windows(&output.scores, &flags, length);
            windows
        });
        let last = output.t.last().copied().unwrap_or(0.0);
        let duration_s = duration_s(truth, last);
        Some(Self {
            output,
            matching: Matching::of(truth, &output.events, request.set.recovery_s),
            samples,
            windows,
            eventful: !truth.events.is_empty(),
            duration_s,
            free_s: free_s(truth, duration_s),
            in_alarm_s: in_alarm(truth, duration_s, &output.events),
        })
    }
}

/// Figures per sample; NaN if there is no contact or no contact-free sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SampleNumbers {
    /// Number of scored samples (or windows).
    pub count: usize,
    /// Share of them that are in a contact.
    pub contact_share: f64,
    /// F1 at the detector's threshold.
    pub f1: f64,
    /// Best F1 over thresholds at mean + i standard deviations of the validation scores.
    pub best_f1: f64,
    /// The i of the best F1.
    pub best_sigmas: f64,
    /// Area under the receiver operating characteristic.
    pub auc: f64,
}

impl SampleNumbers {
    fn of(labelled: &Labelled, runner: &Runner) -> Self {
        let statistics = runner.statistics;
        let (best_f1, best_sigmas) =
            labelled.best_f1(statistics.mean, statistics.standard_deviation);
        Self {
            count: labelled.scores.len(),
            contact_share: labelled.share(),
            f1: labelled.f1(runner.threshold),
            best_f1,
            best_sigmas,
            auc: labelled.auc(),
        }
    }
}

/// All performance figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Numbers {
    /// Figures per sample.
    pub samples: SampleNumbers,
    /// Figures per window, for a detector that judges windows.
    pub windows: Option<SampleNumbers>,
    /// Number of labelled events.
    pub events: usize,
    /// Number of events that were found.
    pub found: usize,
    /// Number of all alarms, including repetitions during an event and those in the recovery time after one.
    pub alarms: usize,
    /// Number of detections that match no event.
    pub false_alarms: usize,
    /// False alarms per hour of contact-free time.
    pub false_alarms_per_hour: f64,
    /// One-sided 95 % upper bound on the rate of false alarms (Poisson) \[1/h\].
    pub false_alarms_per_hour_bound: f64,
    /// Number of alarms that begin outside every labelled contact, without tolerance, recovery time or merging.
    pub strict_false_alarms: usize,
    /// Strict false alarms per hour of contact-free time.
    pub strict_false_alarms_per_hour: f64,
    /// Contact-free time \[h\].
    pub free_hours: f64,
    /// Share of the contact-free time in alarm.
    pub free_share_in_alarm: f64,
    /// Delay from beginning to alarm \[s\].
    pub delay_s: Distribution,
    /// Number of events with a labelled link.
    pub links: usize,
    /// Number of these whose link was reported first.
    pub link_exact: usize,
    /// Number of these for which the link or a neighbour was reported first.
    pub link_within_one: usize,
    /// Number of these for which exactly one link was reported.
    pub link_alone: usize,
    /// Number of these for which exactly one link was reported, and it was right.
    pub link_alone_exact: usize,
    /// Number of these whose link was reported, alone or as one of two.
    pub link_told: usize,
    /// Angle between the true and the estimated force \[deg\].
    pub force_error_deg: Distribution,
}

impl Numbers {
    /// Computes the figures of a detector over these recordings.
    pub fn of(request: &Request, runner: &Runner, scored: &[&Scored<'_>]) -> Self {
        let together = |part: &dyn Fn(&Scored<'_>) -> Option<Labelled>| {
            let mut all = Labelled::default();
            for labelled in scored.iter().filter_map(|one| part(one)) {
                all.scores.extend(labelled.scores);
                all.positive.extend(labelled.positive);
            }
            all
        };
        let samples = together(&|one| Some(one.samples.clone()));
        let windows = runner
            .window()
            .map(|_| together(&|one| one.windows.clone()));
        let matched: Vec<Matched<'_>> = (scored.iter())
            .flat_map(|one| one.matching.events.clone())
            .collect();
        let false_alarms = scored
            .iter()
            .map(|one| one.matching.false_alarms.len())
            .sum();
        let strict_false_alarms: usize = (scored.iter())
            .map(|one| one.matching.strict_false_alarms)
            .sum();
        let free_hours = scored.iter().map(|one| one.free_s).sum::<f64>() / 3600.0;
        let alarm_s: f64 = scored.iter().map(|one| one.in_alarm_s.0).sum();
        let grid_s: f64 = scored.iter().map(|one| one.in_alarm_s.1).sum();
        let places = matched.iter().filter_map(|matched| {
            let truly = request.place(matched.event.link.as_deref()?)?;
            let said = matched.detection.and_then(|d| d.link.as_deref());
            Some((truly, said.and_then(|link| request.place(link))))
        });
        let distances: Vec<Option<usize>> = places
            .map(|(truly, said)| Some(truly.abs_diff(said?)))
            .collect();
        let told: Vec<ToldLinks> = (matched.iter())
            .filter_map(|matched| ToldLinks::of(request, matched))
            .collect();
        let within = |limit: usize| {
            let near = |distance: &&Option<usize>| distance.is_some_and(|d| d <= limit);
            distances.iter().filter(near).count()
        };
        Self {
            samples: SampleNumbers::of(&samples, runner),
            windows: windows.map(|windows| SampleNumbers::of(&windows, runner)),
            events: matched.len(),
            alarms: scored.iter().map(|one| one.output.events.len()).sum(),
            found: matched.iter().filter(|m| m.detection.is_some()).count(),
            false_alarms,
            false_alarms_per_hour: false_alarms as f64 / free_hours,
            false_alarms_per_hour_bound: poisson_bound_95(false_alarms) / free_hours,
            strict_false_alarms,
            strict_false_alarms_per_hour: strict_false_alarms as f64 / free_hours,
            free_hours,
            free_share_in_alarm: alarm_s / grid_s,
            delay_s: Distribution::of(matched.iter().filter_map(Matched::delay_s)),
            links: distances.len(),
            link_exact: within(0),
            link_within_one: within(1),
            link_alone: told.iter().filter(|told| told.is_alone).count(),
            link_alone_exact: (told.iter())
                .filter(|told| told.is_alone && told.is_right)
                .count(),
            link_told: told.iter().filter(|told| told.is_right).count(),
            force_error_deg: Distribution::of(matched.iter().filter_map(force_error_deg)),
        }
    }
}

/// Links reported for a contact whose link is labelled.
struct ToldLinks {
    /// Exactly one link was reported.
    is_alone: bool,
    /// The touched link is among them.
    is_right: bool,
}

impl ToldLinks {
    fn of(request: &Request, matched: &Matched<'_>) -> Option<Self> {
        let truly = request.place(matched.event.link.as_deref()?)?;
        let place = |link: Option<&String>| link.and_then(|link| request.place(link));
        let first = place(matched.detection.and_then(|said| said.link.as_ref()));
        let other = place(matched.detection.and_then(|said| said.other_link.as_ref()));
        Some(Self {
            is_alone: first.is_some() && other.is_none(),
            is_right: [first, other].contains(&Some(truly)),
        })
    }
}

/// Angle between the true and the estimated force, where both are known \[deg\].
pub fn force_error_deg(matched: &Matched<'_>) -> Option<f64> {
    let (truly, said) = (matched.event.force?, matched.detection?.force?);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let lengths = (dot(truly, truly) * dot(said, said)).sqrt();
    (lengths > 0.0).then(|| {
        (dot(truly, said) / lengths)
            .clamp(-1.0, 1.0)
            .acos()
            .to_degrees()
    })
}
