//! What the last moments of the motion predict of a remainder, where no curve over the present moment does: something that
//! gives way and swings (a pedestal, a frame, a loose tool), a channel that is late or read now and then, a scale that changes
//! with time or angle.
//!
//! A few groups of columns are tried, as curves are (`select/carried.rs`): each is fitted to the other recordings and must
//! predict more of a recording that was left out than of surrogates.

use std::f64::consts::TAU;
use std::sync::Arc;

use tauscope_dynamics::terms::words::number;
use tauscope_dynamics::terms::{MotionSample, sign};

use crate::data::column::Column;
use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::select::carried::Carried;

/// How long ago the motion still counts \[s\].
/// Resolution: spacing near the comparison's fastest response, 1 / (2 pi 8 Hz) = 0.02 s; what swings longer is seen by its
/// first swing.
const LAGS_S: [f64; 5] = [0.0, 0.03, 0.06, 0.1, 0.16];
/// What swings: its frequencies, each so many times the one before \[Hz\], from the first to the comparison's cutoff.
/// Resolution: with the damping below neighbours overlap at half their height.
const SWING_FIRST_HZ: f64 = 1.0;
/// See [`SWING_FIRST_HZ`].
const SWING_STEP: f64 = 1.1;
/// Damping of what swings, as a share of the critical one.
/// Physical: steel structures have 0.01 to 0.05, liquids in tanks about as much.
const SWING_DAMPING: f64 = 0.04;
/// How long what a joint has worked keeps it warm \[s\].
/// Resolution: steps of about three; a winding or a sensor of a few grams, seen in recordings of ten seconds.
const WARM_S: [f64; 3] = [1.0, 3.0, 10.0];
/// Share of the remainder's squares that a group must predict in recordings left out.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SHARE: f64 = 0.1;
/// What surrogates predict at most, in standard deviations above their mean. More than for a curve, which must also repeat.
/// Statistical: a Gumbel variable exceeds this once in 1000: once in 150 arms of six joints.
const BEYOND_CHANCE: f64 = 5.0;

/// Nothing is tried at a joint whose remaining variance is below this many times that of the white noise.
/// Tuned: as for curves; not swept.
const LEAST_EXCESS: f64 = 1.6;

/// What predicts a remainder.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Share of its squares in recordings left out.
    pub share: f64,
    /// On what it depends, in words.
    pub on: String,
}

/// Reads one number of the motion of a joint.
type Reading = dyn Fn(&MotionSample<'_>, f64) -> f64;

/// Columns that are tried together, and what they stand for.
struct Group {
    on: String,
    columns: Vec<Column>,
}

/// What predicts most of the remainder of `fit` at a joint, if that is more than chance. `joints` are the names of all.
pub fn predicts(problem: &Problem, fit: &Fit, joint: usize, joints: &[String]) -> Option<History> {
    let noise = problem.white_noise[joint] * problem.white_noise[joint];
    if fit.variance[joint] < LEAST_EXCESS * noise {
        return None;
    }
    let all = groups(problem, fit, joint, joints);
    let tried: Vec<(String, Carried)> = (all.into_iter())
        .filter_map(|group| {
            let carried = Carried::of(problem, &fit.residual, joint, &group.columns)?;
            Some((group.on, carried))
        })
        .collect();
    let by_chance =
        Carried::largest_by_chance(tried.iter().map(|(_, carried)| carried), BEYOND_CHANCE);
    let best = (tried.into_iter()).max_by(|(_, a), (_, b)| a.share.total_cmp(&b.share));
    let (on, carried) = best?;
    let share = carried.share;
    (share > by_chance.max(LEAST_SHARE)).then_some(History { share, on })
}

fn groups(problem: &Problem, fit: &Fit, joint: usize, joints: &[String]) -> Vec<Group> {
    let load = fit.load(problem);
    let lagged = |read: &Reading| -> Vec<Column> {
        let signal = signals(problem, &load, joint, read);
        let late = |lag_s: &f64| column(problem, &late_by(problem, &signal, *lag_s), joint);
        LAGS_S.iter().map(late).collect()
    };
    let warm = |warm_s: &f64| {
        let heat = signals(problem, &load, joint, &|_, load| load * load);
        column(problem, &faded(problem, &heat, *warm_s), joint)
    };
    let now = |read: &Reading| column(problem, &signals(problem, &load, joint, read), joint);
    let mut all = vec![
        Group {
            on: "how its load came about in the last 0.16 s: an effort that is late, filtered, or read now and then".to_owned(),
            columns: lagged(&|_, load| load),
        },
        Group {
            on: "its load together with its angle, its speed and the time of the session: a scale that changes".to_owned(),
            columns: vec![
                now(&move |at, load| load * at.position[joint].sin()),
                now(&move |at, load| load * at.position[joint].cos()),
                now(&move |at, load| load * at.velocity[joint].abs()),
                now(&|at, load| load * at.session_s),
                now(&move |at, load| load * sign(at.velocity[joint])),
            ],
        },
    ];
    all.push(Group {
        on: "how hard it has worked in the last seconds, as heat does: a motor, a drive or a sensor that warms up".to_owned(),
        columns: WARM_S.iter().map(warm).collect(),
    });
    for (other, name) in joints.iter().enumerate() {
        let whose = if other == joint {
            "its own".to_owned()
        } else {
            format!("joint {name}'s")
        };
        all.push(Group {
            on: format!(
                "{whose} acceleration of the last 0.16 s: something gives way and swings, such as a base, a frame or a tool"
            ),
            columns: lagged(&move |at, _| at.acceleration[other]),
        });
    }
    let mut hz = SWING_FIRST_HZ;
    while hz < problem.cutoff_hz {
        all.push(swinging(problem, joint, hz));
        hz *= SWING_STEP;
    }
    all
}

/// Something that swings at a frequency and is driven by the accelerations of all joints.
fn swinging(problem: &Problem, joint: usize, hz: f64) -> Group {
    let mut columns = Vec::new();
    for other in 0..problem.joints {
        let (mut sine, mut cosine) = (Vec::new(), Vec::new());
        for track in &problem.tracks {
            let (rate, turn) = (SWING_DAMPING * TAU * hz, TAU * hz);
            let mut state = [0.0_f64; 2];
            let (mut of_sine, mut of_cosine) = (Vec::new(), Vec::new());
            track.track.each(|_, at| {
                let (sin, cos) = (turn * at.dt_s).sin_cos();
                let fades = (-rate * at.dt_s).exp();
                let [a, b] = state;
                let driven = at.acceleration[other] * at.dt_s;
                state = [
                    fades * (cos * a - sin * b) + driven,
                    fades * (sin * a + cos * b),
                ];
                of_cosine.push(state[0]);
                of_sine.push(state[1]);
            });
            sine.push(of_sine);
            cosine.push(of_cosine);
        }
        columns.push(column(problem, &sine, joint));
        columns.push(column(problem, &cosine, joint));
    }
    Group {
        on: format!(
            "how the arm has accelerated before, and swings at about {} Hz: something gives way, such as the base, a frame, the \
             tool or a liquid in it",
            number(hz)
        ),
        columns,
    }
}

/// A reading at every sample of every track.
fn signals(
    problem: &Problem,
    load: &Arc<TrackEfforts>,
    joint: usize,
    read: &Reading,
) -> Vec<Vec<f64>> {
    let of_track = |(track, load): (&crate::data::track::FitTrack, &Vec<f64>)| {
        let mut values = Vec::with_capacity(track.track.time_s.len());
        track.track.each(|k, at| {
            values.push(read(at, load[k * problem.joints + joint]));
        });
        values
    };
    problem
        .tracks
        .iter()
        .zip(load.iter())
        .map(of_track)
        .collect()
}

/// A signal as it was `lag_s` before; the first sample is held.
fn late_by(problem: &Problem, signal: &[Vec<f64>], lag_s: f64) -> Vec<Vec<f64>> {
    let of_track = |(track, signal): (&crate::data::track::FitTrack, &Vec<f64>)| {
        let time = &track.track.time_s;
        let mut then = 0;
        (0..signal.len())
            .map(|k| {
                while then < k && time[then + 1] <= time[k] - lag_s {
                    then += 1;
                }
                signal[then]
            })
            .collect()
    };
    problem.tracks.iter().zip(signal).map(of_track).collect()
}

/// A signal that is kept for a while, and fades with this time constant.
fn faded(problem: &Problem, signal: &[Vec<f64>], constant_s: f64) -> Vec<Vec<f64>> {
    let of_track = |(track, signal): (&crate::data::track::FitTrack, &Vec<f64>)| {
        let time = &track.track.time_s;
        let mut kept = 0.0;
        let mut values = Vec::with_capacity(signal.len());
        for (k, value) in signal.iter().enumerate() {
            let step_s = time[k] - time[k.saturating_sub(1)];
            kept += (1.0 - (-step_s / constant_s).exp()) * (value - kept);
            values.push(kept);
        }
        values
    };
    problem.tracks.iter().zip(signal).map(of_track).collect()
}

/// A signal as a column of a joint.
fn column(problem: &Problem, signal: &[Vec<f64>], joint: usize) -> Column {
    let n = problem.joints;
    let spread = |values: &Vec<f64>| {
        let mut effort = vec![0.0; values.len() * n];
        for (k, value) in values.iter().enumerate() {
            effort[k * n + joint] = *value;
        }
        effort
    };
    let efforts: Vec<Vec<f64>> = signal.iter().map(spread).collect();
    problem.column(&efforts, Some(joint))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, problem, recording};

    /// What is said of three recordings of two joints in which `add` is added to the first joint's effort, given the efforts of
    /// the present and of the samples before, the newest last.
    fn said(mut add: impl FnMut(&[f64]) -> f64) -> Option<History> {
        let model = model();
        let mut noise = Noise(3);
        let recordings = [1, 2, 3].map(|seed| {
            let mut efforts = Vec::new();
            recording(&model, seed, |_, _, effort| {
                efforts.push(effort[0]);
                effort[0] += add(&efforts) + 0.02 * noise.next();
                effort[1] += 0.02 * noise.next();
            })
        });
        let problem = problem(&model, &recordings);
        let nothing = Fit::new(&problem, Vec::new());
        let joints = ["shoulder".to_owned(), "elbow".to_owned()];
        predicts(&problem, &nothing, 0, &joints)
    }

    #[test]
    fn a_channel_that_is_read_now_and_then_follows_its_load() {
        let said = said(|efforts| {
            let held = efforts[(efforts.len() - 1) / 10 * 10];
            held - efforts[efforts.len() - 1]
        });
        let said = said.expect("half of it is a delay");
        assert!(said.on.contains("read now and then"), "{}", said.on);
    }

    #[test]
    fn what_swings_after_the_arm_has_accelerated_is_told_with_its_frequency() {
        let (mut swing, mut before) = ([0.0_f64; 2], [0.0_f64; 2]);
        let said = said(|efforts| {
            if efforts.len() == 1 {
                (swing, before) = ([0.0; 2], [efforts[0]; 2]);
            }
            let now = efforts[efforts.len() - 1];
            // The effort's second difference stands for what drives it.
            let drive = now - 2.0 * before[0] + before[1];
            before = [now, before[0]];
            let (sin, cos) = (TAU * 3.0 * 0.01).sin_cos();
            let fades = (-0.03 * TAU * 3.0 * 0.01_f64).exp();
            let [a, b] = swing;
            swing = [
                fades * (cos * a - sin * b) + 20.0 * drive,
                fades * (sin * a + cos * b),
            ];
            swing[1]
        });
        let said = said.expect("it follows from the motion");
        assert!(said.on.contains("Hz"), "{}", said.on);
    }

    #[test]
    fn a_zero_that_follows_the_heat_is_told_with_it() {
        let (mut heat, mut before) = (0.0, 0);
        let said = said(|efforts| {
            if efforts.len() < before {
                heat = 0.0;
            }
            before = efforts.len();
            let load = efforts[efforts.len() - 1];
            heat += 0.01 / 3.0 * (load * load - heat);
            0.01 * heat
        });
        let said = said.expect("it follows from the load");
        assert!(said.on.contains("heat"), "{}", said.on);
    }

    #[test]
    fn slow_noise_follows_nothing() {
        let mut noise = Noise(7);
        let mut slow = 0.0;
        let said = said(|_| {
            slow = 0.98 * slow + 0.2 * noise.next();
            slow
        });
        assert_eq!(said, None);
    }
}
