//! The data of a fit: smoothed motion, rigid-body effort and filtered measured effort of the recordings.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use tauscope_dynamics::terms::Expansion;
use tauscope_dynamics::{Data, Model};

use crate::data::effective_samples::worth;
use crate::data::smoother::LowPass;
use crate::data::track::{FitTrack, Track, moving_joints, spaced, thinned};
use crate::physics::active::Hypothesis;
use crate::physics::bodies::UnitCosts;
use crate::physics::columns::ColumnCache;
use crate::physics::efforts::Efforts;
use crate::read::recording::Recording;

/// What is compared lies below this frequency, unless the recordings are too slow for it \[Hz\].
const CUTOFF_HZ: f64 = 8.0;
/// The cutoff is at most this share of the sample rate.
const CUTOFF_OF_RATE: f64 = 0.1;
/// Motion is smoothed this many times higher, so that its filter does not show below the cutoff.
const MOTION_CUTOFF_RATIO: f64 = 2.0;
/// Recordings faster than this are thinned for the fit \[Hz\]; where there are many samples down to the lower.
const FIT_RATE_HZ: [f64; 2] = [50.0, 130.0];
/// From how many samples on.
const FIT_SAMPLES: f64 = 8000.0;
/// Fast recordings are filtered this many times higher than what is compared before they are thinned.
const ALIASING_RATIO: f64 = 5.0;

/// Everything that a fit works on. A *signal* is joint-major: `rows` numbers for joint 0, then for joint 1,
/// and so on; the rows of each joint are those of the tracks, one after the other.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The robot.
    pub model: Model,
    /// Number of joints.
    pub joints: usize,
    /// The recordings.
    pub tracks: Vec<FitTrack>,
    /// Rows per joint.
    pub rows: usize,
    /// Measured effort, filtered \[N m or N\].
    pub measured: Vec<f64>,
    /// 1 where a joint's row counts, 0 where it stands still or the filters have no footing.
    pub weight: Vec<f64>,
    /// Standard deviation of the measured effort's white noise after the filter, by joint \[N m\]: the least
    /// that any model can leave.
    pub white_noise: Vec<f64>,
    /// Largest measured effort by joint, unfiltered \[N m\].
    pub largest_effort: Vec<f64>,
    /// Half amplitude of the filter \[Hz\].
    pub cutoff_hz: f64,
    /// Independent samples that a row of noise is worth, by joint.
    pub worth: Vec<f64>,
    /// Coulomb and viscous friction by joint that the twin has already: by so much they may be less.
    pub known_friction: Vec<BTreeMap<&'static str, f64>>,
    /// Columns that were computed before.
    pub cache: Arc<ColumnCache>,
    /// What unit bodies cost.
    pub units: Arc<UnitCosts>,
    bare: OnceLock<Efforts>,
    rigid: OnceLock<Vec<f64>>,
    expansions: Vec<OnceLock<Arc<Expansion>>>,
}

impl Problem {
    /// The frequency below which these recordings are compared \[Hz\].
    pub fn cutoff_hz(recordings: &[Recording]) -> f64 {
        let rate = |r: &Recording| (r.len() - 1) as f64 / r.duration_s().max(1e-3);
        let slowest = recordings.iter().map(rate).fold(f64::INFINITY, f64::min);
        CUTOFF_HZ.min(CUTOFF_OF_RATE * slowest)
    }

    /// The half amplitude of the smoother of motion for a comparison below `cutoff_hz` \[Hz\].
    pub fn motion_cutoff_hz(cutoff_hz: f64) -> f64 {
        MOTION_CUTOFF_RATIO * cutoff_hz
    }

    /// Prepares recordings with effort, and their `tracks` at all samples, for a fit below `cutoff_hz`; `unit_nm`
    /// turns the recordings' unit into N m, by joint. Standstills of the joints in `rests_count` are compared, too.
    pub fn new(
        model: &Model,
        recordings: &[Recording],
        tracks: Vec<Track>,
        cutoff_hz: f64,
        unit_nm: &[f64],
        rests_count: &[bool],
    ) -> Self {
        let n = model.dof();
        let mut problem = Self {
            model: model.clone(),
            joints: n,
            tracks: Vec::new(),
            rows: 0,
            measured: Vec::new(),
            weight: Vec::new(),
            white_noise: vec![0.0; n],
            largest_effort: vec![0.0; n],
            cutoff_hz,
            worth: Vec::new(),
            known_friction: vec![BTreeMap::new(); n],
            cache: Arc::default(),
            units: Arc::default(),
            bare: OnceLock::new(),
            rigid: OnceLock::new(),
            expansions: vec![OnceLock::new(); n],
        };
        let (mut measured, mut weight) = (Vec::new(), Vec::new());
        let mut variances = vec![Vec::new(); n];
        let total_s: f64 = recordings.iter().map(Recording::duration_s).sum();
        let fit_rate_hz = (FIT_SAMPLES / total_s).clamp(FIT_RATE_HZ[0], FIT_RATE_HZ[1]);
        let tracks: Vec<(Track, Track, Vec<usize>)> = tracks
            .into_iter()
            .map(|full| {
                let kept = thinned(&full.time_s, 1.0 / fit_rate_hz);
                (full.thin(&kept, n), full, kept)
            })
            .collect();
        let moves = moving_joints(tracks.iter().map(|(track, _, _)| track), n);
        for (recording, (track, full, kept)) in recordings.iter().zip(tracks) {
            let compared = spaced(&track.time_s, 0.5 / cutoff_hz);
            let mut filters = Vec::with_capacity(n);
            for j in 0..n {
                let counts = track.counts(j, moves[j] && !rests_count[j], cutoff_hz);
                let filter = LowPass::weighted(&track.time_s, cutoff_hz, |k| counts[k]);
                let of_joint = (0..full.len()).map(|k| k * n + j);
                let largest = of_joint.clone().fold(0.0_f64, |most, at| {
                    most.max((recording.effort[at] * unit_nm[j]).abs())
                });
                problem.largest_effort[j] = problem.largest_effort[j].max(largest);
                let mut signal: Vec<f64> = of_joint
                    .map(|at| (recording.effort[at] - full.beside[at]) * unit_nm[j])
                    .collect();
                let rate = (full.len() - 1) as f64 / recording.duration_s();
                variances[j].push(white_variance(&signal) * cutoff_hz * 0.95 / (0.5 * rate));
                if kept.len() < full.len() {
                    // Against aliasing.
                    LowPass::new(&full.time_s, ALIASING_RATIO * cutoff_hz).apply(&mut signal);
                }
                let mut signal: Vec<f64> = kept.iter().map(|&k| signal[k]).collect();
                filter.apply(&mut signal);
                measured.push(compared.iter().map(|&k| signal[k]).collect::<Vec<_>>());
                weight.push(
                    compared
                        .iter()
                        .map(|&k| f64::from(counts[k]))
                        .collect::<Vec<_>>(),
                );
                filters.push(filter);
            }
            let first_row = problem.rows;
            problem.rows += compared.len();
            problem.tracks.push(FitTrack {
                track,
                filters,
                compared,
                first_row,
            });
        }
        for j in 0..n {
            for r in 0..recordings.len() {
                problem.measured.extend(&measured[r * n + j]);
                problem.weight.extend(&weight[r * n + j]);
            }
            variances[j].sort_by(f64::total_cmp);
            problem.white_noise[j] = variances[j][variances[j].len() / 2].sqrt();
        }
        problem.worth = worth(&problem);
        problem
    }

    /// The least that a factor of a hypothesis may be: a friction that the twin has already may be less.
    pub fn least(&self, hypothesis: Hypothesis, minimum: f64) -> f64 {
        let known = &self.known_friction[hypothesis.place.joint];
        minimum - known.get(hypothesis.effect.name).copied().unwrap_or(0.0)
    }

    /// The same where one recording does not count.
    #[must_use]
    pub fn without(&self, track: usize) -> Self {
        let mut others = self.clone();
        for joint in 0..self.joints {
            let rows = others.joint_rows(joint);
            others.weight[rows][self.tracks[track].rows()].fill(0.0);
        }
        others
    }

    /// What the twin says without any physics beside it.
    pub fn bare(&self) -> &Efforts {
        self.bare.get_or_init(|| {
            let rigid = self.tracks.iter().map(|t| t.track.rigid.clone()).collect();
            Efforts::of_bodies(Arc::new(rigid), self.joints)
        })
    }

    /// The same as a signal.
    pub fn rigid(&self) -> &[f64] {
        self.rigid.get_or_init(|| self.signal(&self.bare().body))
    }

    /// What bodies cost as a joint's link leaves the motion, over all tracks.
    pub fn expansion(&self, joint: usize) -> &Arc<Expansion> {
        self.expansions[joint].get_or_init(|| {
            let (model, mut data) = (&self.model, Data::new(&self.model));
            let mut all = Expansion::new(model, joint);
            for track in &self.tracks {
                track.track.each(|_, at| {
                    all.push(model, &mut data, at.position, at.velocity, at.acceleration);
                });
            }
            Arc::new(all)
        })
    }

    /// The part of a signal that is joint `joint`'s.
    pub fn joint_rows(&self, joint: usize) -> std::ops::Range<usize> {
        joint * self.rows..(joint + 1) * self.rows
    }

    /// Filters efforts over all tracks (row-major, one `Vec` per track) into a signal.
    pub fn signal(&self, efforts: &[Vec<f64>]) -> Vec<f64> {
        let mut signal = vec![0.0; self.joints * self.rows];
        for j in 0..self.joints {
            self.joint_signal(efforts, j, &mut signal[j * self.rows..(j + 1) * self.rows]);
        }
        signal
    }

    /// The same for one joint.
    pub fn joint_signal(&self, efforts: &[Vec<f64>], joint: usize, into: &mut [f64]) {
        for (track, effort) in self.tracks.iter().zip(efforts) {
            let one = effort
                .iter()
                .skip(joint)
                .step_by(self.joints)
                .copied()
                .collect();
            track.compare(joint, one, &mut into[track.rows()]);
        }
    }
}

/// Variance of the white noise on a smooth signal, from its fourth differences, robust against jumps.
pub fn white_variance(signal: &[f64]) -> f64 {
    let mut squares: Vec<f64> = signal
        .windows(5)
        .map(|x| (x[0] - 4.0 * x[1] + 6.0 * x[2] - 4.0 * x[3] + x[4]).abs())
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    squares.sort_by(f64::total_cmp);
    // The median of |normal| is 0.6745 standard deviations; 70 = 1 + 16 + 36 + 16 + 1.
    let deviation = squares[squares.len() / 2] / 0.6745;
    deviation * deviation / 70.0
}
