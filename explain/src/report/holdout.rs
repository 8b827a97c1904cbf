//! The error of the corrected twin on held-out recordings.

use tauscope_dynamics::terms::{Physics, TermError};

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::fit::fitted::{Fit, LEAST_VARIANCE};
use crate::physics::active::{Active, in_order};
use crate::physics::carrier::is_on_carrier;
use crate::read::recording::Recording;
use crate::report::schema::{JointPicture, RecordingPicture};

/// Cutoffs of the motion of a prediction in the grid, relative to the fit's cutoff. The best on the fitted recordings
/// is used.
/// Resolution: steps of about 1.4; the fitted recordings decide.
const PREDICTION_CUTOFFS: [f64; 5] = [0.75, 1.0, 1.4, 2.0, 3.0];
/// Cutoffs of the velocity of friction in the grid, relative to the motion's cutoff. The recorded velocity is tried,
/// too: friction depends on the sign of velocities of a few mrad/s.
/// Resolution: octaves; the fitted recordings decide.
const VELOCITY_CUTOFFS: [f64; 3] = [2.0, 4.0, 8.0];
/// Highest cutoff of the velocity, relative to the sample rate.
/// Physical: below half the sample rate, the Nyquist frequency.
const MOST_OF_RATE: f64 = 0.4;
/// Largest number of samples of a plot.
/// Resolution: about two per pixel of a plot; changes the file's size.
const PICTURE_SAMPLES: usize = 2000;

/// Errors on the held-out recordings, predictions and plots.
pub struct Proof {
    /// RMS error of the initial twin, by joint \[effort unit\].
    pub before: Vec<f64>,
    /// RMS error of the corrected twin, by joint \[effort unit\].
    pub after: Vec<f64>,
    /// Joints that keep the initial twin, because their correction does not predict recordings that were left out of
    /// the fit.
    pub kept: Vec<usize>,
    /// The corrected twin's effort by held-out recording; NaN in rows that were lost on reading.
    pub predictions: Vec<(String, Vec<f64>)>,
    /// Series of the plots, held-out recordings first.
    pub pictures: Vec<RecordingPicture>,
}

/// Smoothing of the motion of a prediction.
#[derive(Debug, Clone, Copy)]
struct Smoothing {
    motion_hz: f64,
    velocity: Velocity,
}

/// The source of the velocity that friction depends on.
#[derive(Debug, Clone, Copy)]
enum Velocity {
    AsMotion,
    /// Smoothed positions, with half amplitude at this frequency \[Hz\].
    Smoothed(f64),
    Recorded,
}

impl Context<'_> {
    /// Computes the corrected twin's effort over a track, in the recording's unit.
    pub fn predict(&self, problem: &Problem, fit: &Fit, track: &Track) -> Vec<f64> {
        let carrier = fit.parts.carrier.as_deref();
        let robot = |active: &Active| carrier.filter(|_| is_on_carrier(active));
        let terms = in_order(&fit.actives)
            .into_iter()
            .map(|active| {
                active.term(robot(active).map_or(&problem.model, |carrier| carrier.robot(active)))
            })
            .collect();
        let mut physics = Physics::new(terms, self.unit_nm.len());
        let mut effort = track.run(&mut physics, &track.rigid);
        for (k, value) in effort.iter_mut().enumerate() {
            *value = *value / self.unit_nm[k % self.unit_nm.len()] + track.beside[k];
        }
        effort
    }

    /// Returns the negative log-likelihood per sample of the fitted recordings' unfiltered effort with this
    /// smoothing, up to factor and constant.
    fn unlikeliness(
        &self,
        problem: &Problem,
        found: &Fit,
        smoothing: &Smoothing,
    ) -> Result<f64, TermError> {
        let n = self.unit_nm.len();
        let mut sum = vec![0.0; n];
        let mut count = 0.0;
        for recording in &self.input.fit {
            let track = self.smoothed(recording, smoothing)?;
            let predicted = self.predict(problem, found, &track);
            for (k, (p, m)) in predicted.iter().zip(&recording.effort).enumerate() {
                sum[k % n] += (m - p) * (m - p);
            }
            count += recording.len() as f64;
        }
        Ok(sum
            .iter()
            .map(|s| (s / count).max(LEAST_VARIANCE).ln())
            .sum())
    }

    fn smoothed(&self, recording: &Recording, by: &Smoothing) -> Result<Track, TermError> {
        let mut track = self.track(recording, by.motion_hz)?;
        match by.velocity {
            Velocity::AsMotion => {}
            Velocity::Smoothed(hz) => track.sharpen_velocity(recording, Some(hz)),
            Velocity::Recorded => track.sharpen_velocity(recording, None),
        }
        Ok(track)
    }

    /// Returns the smoothing with the best prediction of the fitted recordings' unfiltered effort.
    fn best_smoothing(&self, problem: &Problem, found: &Fit) -> Result<Smoothing, TermError> {
        let start = Smoothing {
            motion_hz: Problem::motion_cutoff_hz(problem.cutoff_hz),
            velocity: Velocity::AsMotion,
        };
        let mut best = (f64::INFINITY, start);
        let try_it = |smoothing: Smoothing, best: &mut (f64, Smoothing)| {
            let unlikeliness = self.unlikeliness(problem, found, &smoothing)?;
            if unlikeliness < best.0 {
                *best = (unlikeliness, smoothing);
            }
            Ok::<(), TermError>(())
        };
        for share in PREDICTION_CUTOFFS {
            let motion_hz = share * problem.cutoff_hz;
            try_it(Smoothing { motion_hz, ..start }, &mut best)?;
        }
        let motion_hz = best.1.motion_hz;
        let fit = &self.input.fit;
        let most_hz = MOST_OF_RATE
            * fit
                .iter()
                .map(Recording::rate_hz)
                .fold(f64::INFINITY, f64::min);
        let sharper = VELOCITY_CUTOFFS.map(|times| (times * motion_hz).min(most_hz));
        let mut velocities: Vec<Velocity> = sharper.into_iter().map(Velocity::Smoothed).collect();
        let is_recorded = |r: &Recording| {
            r.velocity.len() == r.position.len() && r.velocity.iter().all(|v| v.is_finite())
        };
        if fit.iter().chain(&self.input.holdout).all(is_recorded) {
            velocities.push(Velocity::Recorded);
        }
        for velocity in velocities {
            let smoothing = Smoothing {
                motion_hz,
                velocity,
            };
            try_it(smoothing, &mut best)?;
        }
        Ok(best.1)
    }

    /// Returns the RMS error by joint of the initial twin on the held-out recordings \[effort unit\]; NaN where no
    /// effort was recorded.
    ///
    /// # Errors
    /// If a term of the start cannot be built for the robot.
    pub fn rigid_errors(&self) -> Result<Vec<f64>, TermError> {
        let n = self.unit_nm.len();
        let motion_hz = Problem::motion_cutoff_hz(Problem::cutoff_hz(&self.input.fit));
        let mut errors = Errors::new(n);
        for recording in &self.input.holdout {
            let track = self.track(recording, motion_hz)?;
            let rows = track.rigid.iter().zip(&track.beside).enumerate();
            let twin = rows.map(|(k, (rigid, beside))| rigid / self.unit_nm[k % n] + beside);
            errors.add(recording, &twin.collect::<Vec<_>>());
        }
        Ok(errors.rms())
    }

    /// Runs the corrected twin over the held-out recordings; the joints `kept` have the initial twin.
    pub fn proof(
        &self,
        problem: &Problem,
        [scaled, found]: [&Fit; 2],
        kept: Vec<usize>,
    ) -> Result<Proof, TermError> {
        let n = self.unit_nm.len();
        let names: Vec<&str> = self.input.model.joint_names().collect();
        let smoothing = self.best_smoothing(problem, found)?;
        let (mut before, mut after) = (Errors::new(n), Errors::new(n));
        let (mut predictions, mut pictures) = (Vec::new(), Vec::new());
        let held = self.input.holdout.iter().map(|recording| (recording, true));
        let of_fit = self.input.fit.iter().map(|recording| (recording, false));
        for (recording, is_held) in held.chain(of_fit) {
            let track = self.smoothed(recording, &smoothing)?;
            let mut predicted = self.predict(problem, found, &track);
            let rigid = self.predict(problem, scaled, &track);
            for &joint in &kept {
                let own = predicted.iter_mut().skip(joint).step_by(n);
                for (corrected, rigid) in own.zip(rigid.iter().skip(joint).step_by(n)) {
                    *corrected = *rigid;
                }
            }
            if is_held {
                before.add(recording, &rigid);
                after.add(recording, &predicted);
                let mut rows = Vec::with_capacity(recording.sample_of_row.len() * n);
                for sample in &recording.sample_of_row {
                    match sample {
                        Some(k) => rows.extend_from_slice(&predicted[k * n..(k + 1) * n]),
                        None => rows.resize(rows.len() + n, f64::NAN),
                    }
                }
                predictions.push((recording.name.clone(), rows));
            }
            if !recording.effort.is_empty() {
                pictures.push(picture(
                    &names, recording, is_held, &track, &rigid, &predicted,
                ));
            }
        }
        Ok(Proof {
            before: before.rms(),
            after: after.rms(),
            kept,
            predictions,
            pictures,
        })
    }
}

/// Sums of a twin's squared errors by joint, and the number of samples.
struct Errors {
    squares: Vec<f64>,
    count: f64,
}

impl Errors {
    fn new(joints: usize) -> Self {
        Self {
            squares: vec![0.0; joints],
            count: 0.0,
        }
    }

    /// Adds the errors of a recording.
    fn add(&mut self, recording: &Recording, twin: &[f64]) {
        let n = self.squares.len();
        let rows = recording.effort.chunks_exact(n).zip(twin.chunks_exact(n));
        for (measured, twin) in rows {
            for (sum, (measured, twin)) in self.squares.iter_mut().zip(measured.iter().zip(twin)) {
                *sum += (measured - twin).powi(2);
            }
            self.count += 1.0;
        }
    }

    /// Returns the RMS error by joint; NaN where no effort was recorded.
    fn rms(&self) -> Vec<f64> {
        let each = self.squares.iter();
        each.map(|square| (square / self.count).sqrt()).collect()
    }
}

fn picture(
    names: &[&str],
    recording: &Recording,
    held_out: bool,
    track: &Track,
    before: &[f64],
    after: &[f64],
) -> RecordingPicture {
    let n = before.len() / track.len().max(1);
    let stride = track.len().div_ceil(PICTURE_SAMPLES).max(1);
    let joint = |j: usize, name: &str| {
        let thin = |values: &[f64]| -> Vec<f64> {
            (0..track.len())
                .step_by(stride)
                .map(|k| values[k * n + j])
                .collect()
        };
        JointPicture {
            joint: name.to_owned(),
            time_s: track.time_s.iter().step_by(stride).copied().collect(),
            position: thin(&track.position),
            velocity: thin(&track.velocity),
            measured: thin(&recording.effort),
            before: thin(before),
            after: thin(after),
        }
    };
    RecordingPicture {
        recording: recording.name.clone(),
        held_out,
        start_ns: recording.start_ns,
        joints: names
            .iter()
            .enumerate()
            .map(|(j, name)| joint(j, name))
            .collect(),
    }
}
