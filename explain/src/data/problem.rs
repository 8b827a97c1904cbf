//! The data of a fit: smoothed motion, rigid-body effort and filtered measured effort of the recordings.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use tauscope_dynamics::terms::Expansion;
use tauscope_dynamics::{Data, Model};

use crate::data::column::Column;
use crate::data::efforts::{Efforts, TrackEfforts};
use crate::data::memo::{ColumnCache, UnitEfforts};
use crate::data::track::FitTrack;

/// The data of a fit. A *signal* is joint-major: `rows` numbers for joint 0, then for joint 1, and so on. The rows of
/// each joint are those of the tracks in succession.
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
    /// 1 where a joint's row is compared, 0 at its standstills and where the filters lack data.
    pub weight: Vec<f64>,
    /// Standard deviation of the measured effort's white noise after the filter, by joint \[N m\]: the lower bound of
    /// the residual of any model.
    pub white_noise: Vec<f64>,
    /// Largest measured effort by joint, unfiltered \[N m\].
    pub largest_effort: Vec<f64>,
    /// Length-weighted median gap between neighbouring positions, by joint \[rad or m\].
    pub position_gaps: Vec<f64>,
    /// Half-amplitude frequency of the filter \[Hz\].
    pub cutoff_hz: f64,
    /// Coulomb and viscous friction that the twin already contains, by joint: the fit may reduce it by up to this.
    pub known_friction: Vec<BTreeMap<&'static str, f64>>,
    /// Whether the robot's file states that friction; else it was found on this arm before.
    pub states_friction: bool,
    /// Whether the twin is external: a simulation that follows the command and not the measured motion.
    pub is_foreign: bool,
    /// Initial gain of the fit of an unknown torque scale, by joint \[effort unit per model unit\].
    pub first_gains: Vec<f64>,
    /// Cache of computed columns.
    pub cache: Arc<ColumnCache>,
    /// Efforts of unit bodies, computed on first use.
    pub units: Arc<UnitEfforts>,
    /// Effort of the rigid robot along the recorded motion, by joint and sample of all tracks; computed on first use.
    pub recorded: OnceLock<Arc<Vec<f64>>>,
    pub(super) bare: OnceLock<Efforts>,
    pub(super) rigid: OnceLock<Vec<f64>>,
    pub(super) expansions: Vec<OnceLock<Arc<Expansion>>>,
}

impl Problem {
    /// Returns the start of the first recording and the end of the last one \[s from the start of the session\].
    pub fn session_s(&self) -> (f64, f64) {
        let first_s = |t: &FitTrack| t.track.session_s;
        let last_s = |t: &FitTrack| first_s(t) + t.track.time_s.last().copied().unwrap_or(0.0);
        let first = self
            .tracks
            .iter()
            .map(first_s)
            .fold(f64::INFINITY, f64::min);
        (first, self.tracks.iter().map(last_s).fold(first, f64::max))
    }

    /// Returns the highest number of waves per turn that a joint's positions resolve: two positions per wave
    /// (Shannon, "Communication in the Presence of Noise", 1949, theorem 1). Poses far apart do not determine faster
    /// waves.
    pub fn most_waves(&self, joint: usize) -> f64 {
        std::f64::consts::PI / self.position_gaps[joint]
    }

    /// Returns the efforts of the twin without any effect.
    pub fn bare(&self) -> &Efforts {
        self.bare.get_or_init(|| {
            let rigid = self.tracks.iter().map(|t| t.track.rigid.clone()).collect();
            Efforts::of_bodies(Arc::new(rigid))
        })
    }

    /// Returns the efforts of the twin without any effect, as a signal.
    pub fn rigid(&self) -> &[f64] {
        self.rigid.get_or_init(|| self.signal(&self.bare().body))
    }

    /// Returns the expansion of the rigid-body effort for deviations of a joint's link from the motion, over all
    /// tracks.
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

    /// Returns the range of a joint in a signal.
    pub fn joint_rows(&self, joint: usize) -> std::ops::Range<usize> {
        joint * self.rows..(joint + 1) * self.rows
    }

    /// Returns the compared rows of a joint as recording, row of the joint, and sample of the recording's track.
    pub fn counted(&self, joint: usize) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let weight = &self.weight[self.joint_rows(joint)];
        let of = |(recording, track): (usize, &'_ FitTrack)| {
            let rows = track.rows().zip(track.compared.iter().copied());
            rows.map(|(row, k)| (recording, row, k)).collect::<Vec<_>>()
        };
        let all = self.tracks.iter().enumerate().flat_map(of);
        all.filter(|(_, row, _)| weight[*row] > 0.0)
    }

    /// Filters efforts over all tracks (row-major, one `Vec` per track) into a signal.
    pub fn signal(&self, efforts: &[Vec<f64>]) -> Vec<f64> {
        let mut signal = vec![0.0; self.joints * self.rows];
        for j in 0..self.joints {
            self.joint_signal(efforts, j, &mut signal[j * self.rows..(j + 1) * self.rows]);
        }
        signal
    }

    /// Filters the efforts of one joint over all tracks into its rows of a signal.
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

    /// Filters one joint's effort over all tracks, one number per sample, into a column.
    pub fn column_at(&self, joint: usize, effort: TrackEfforts) -> Column {
        let mut values = vec![0.0; self.rows];
        for (track, effort) in self.tracks.iter().zip(effort) {
            // The filter of a zero signal is zero.
            if effort.iter().any(|x| *x != 0.0) {
                track.compare(joint, effort, &mut values[track.rows()]);
            }
        }
        let joint = Some(joint);
        Column { joint, values }
    }

    /// Filters an effort over all tracks into a column of one joint or of all.
    pub fn column(&self, effort: &[Vec<f64>], joint: Option<usize>) -> Column {
        let values = match joint {
            Some(joint) => {
                let mut values = vec![0.0; self.rows];
                self.joint_signal(effort, joint, &mut values);
                values
            }
            None => self.signal(effort),
        };
        Column { joint, values }
    }
}
