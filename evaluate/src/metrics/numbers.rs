//! What a detector did on some recordings, in numbers.

use serde::Serialize;

use super::events::{Matched, Matching, duration_s, free_s, in_alarm};
use super::samples::{Labelled, flags};
use super::statistics::{Distribution, poisson_bound_95};
use crate::input::Request;
use crate::runner::{Output, Runner};

/// One recording's output against its labels.
#[derive(Debug, Clone)]
pub struct Scored<'a> {
    /// The output.
    pub output: &'a Output,
    /// Its events against the labels.
    pub matching: Matching<'a>,
    /// Its samples against the labels.
    pub samples: Labelled,
    /// The same of its windows, for a detector that judges windows.
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
    /// `output` of a detector that judges `window` samples at once; `None` without labels.
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

/// Sample-wise numbers; NaN where there is no contact, or nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SampleNumbers {
    /// How many samples (or windows) were scored.
    pub count: usize,
    /// Share of them that are in a contact.
    pub contact_share: f64,
    /// At the detector's threshold.
    pub f1: f64,
    /// The best over mean + i standard deviations of the validation scores.
    pub best_f1: f64,
    /// Its i.
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

/// All numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Numbers {
    /// Sample by sample.
    pub samples: SampleNumbers,
    /// Window by window, for a detector that judges windows.
    pub windows: Option<SampleNumbers>,
    /// True events.
    pub events: usize,
    /// Those that were found.
    pub found: usize,
    /// Alarms in all: also those that came again while an event lasted, or in the recovery time after one.
    pub alarms: usize,
    /// Detections of nothing.
    pub false_alarms: usize,
    /// The same per hour of contact-free time.
    pub false_alarms_per_hour: f64,
    /// The rate is below this with 95 % confidence (Poisson) \[1/h\].
    pub false_alarms_per_hour_bound: f64,
    /// Alarms that begin outside every labelled contact, nothing forgiven: no tolerance, no recovery time, none merged.
    pub strict_false_alarms: usize,
    /// The same per hour of contact-free time.
    pub strict_false_alarms_per_hour: f64,
    /// Contact-free time \[h\].
    pub free_hours: f64,
    /// Share of the contact-free time in alarm.
    pub free_share_in_alarm: f64,
    /// From beginning to alarm \[s\].
    pub delay_s: Distribution,
    /// Events whose link is known.
    pub links: usize,
    /// Those whose link was named.
    pub link_exact: usize,
    /// Those for which it or a neighbour was named.
    pub link_within_one: usize,
    /// Those for which one link was told and no other, and those of them where it was right.
    pub link_alone: usize,
    /// See above.
    pub link_alone_exact: usize,
    /// Those whose link was told, alone or as one of two.
    pub link_told: usize,
    /// Angle between the true and the estimated force \[deg\].
    pub force_error_deg: Distribution,
}

impl Numbers {
    /// Of a detector over these recordings.
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

/// The links that were told of a contact whose link is known.
struct ToldLinks {
    /// One link was told, and no other.
    is_alone: bool,
    /// The touched one is among them.
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
