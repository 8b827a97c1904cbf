//! The simulated arm under the recorded commands, before and after the correction.

use maud::{Markup, html};
use tauscope_dynamics::{
    ClosedLoop, Commands, Data, Drive, Model, Observed, Servo, gravity_effort,
};
use tauscope_explain::report::{JointPicture, RecordingPicture, Simulated};

use super::chart::{Axis, Panel, r};
use super::models::Corrections;
use super::number_format::number_text;

/// Smallest share of the effort's variance that a controller has to explain at every joint. Chosen: what is not explained acts
/// on the simulated arm as an unknown force.
const LEAST_EXPLAINED: f64 = 0.9;
/// Joints whose motion is drawn. Layout: by eye; no number depends on it.
const DRAWN: usize = 3;
/// Largest plausible deviation of the uncorrected simulation \[rad or m\]. Physical: beyond half a turn it no longer follows.
const LARGEST: f64 = 3.0;

/// Motion of the simulated arm in one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Rollout {
    /// The recording.
    pub recording: String,
    /// Time \[s\].
    pub time_s: Vec<f64>,
    /// By joint.
    pub joints: Vec<RolloutJoint>,
}

/// Motion of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct RolloutJoint {
    /// Its name.
    pub joint: String,
    /// Whether it is prismatic.
    pub slides: bool,
    /// Measured position \[rad or m\].
    pub measured: Vec<f64>,
    /// Position of the simulated arm as its file has it \[rad or m\].
    pub before: Vec<f64>,
    /// Position of the simulated arm with the corrections \[rad or m\].
    pub after: Vec<f64>,
}

/// Simulates the arm in closed loop along a recording with `commands`: a row of commanded positions for each sample of the
/// picture. The controller's gains are fitted to the recorded efforts, which are in N m.
///
/// # Errors
/// In words, why there is nothing to show.
pub fn simulated(
    model: &Model,
    corrections: &Corrections,
    picture: &RecordingPicture,
    commands: &[f64],
) -> Result<Rollout, String> {
    let joints = &picture.joints;
    let time_s = joints.first().map_or(&[][..], |joint| &joint.time_s);
    let n = model.dof();
    if joints.len() != n || commands.len() != n * time_s.len() || time_s.len() < 2 {
        return Err("the recording has no commands for all joints".to_owned());
    }
    let commands = Commands::new(model, time_s, commands);
    let servos = servos(model, joints, &commands)?;
    let drives = |of: &Model| of.joints().iter().map(|joint| joint.drive).collect();
    let (before, after): (Vec<Drive>, _) = (drives(model), corrections.applied(model));
    let run = |arm: &Model, drives: &[Drive]| {
        let first = |of: fn(&JointPicture) -> &[f64]| -> Vec<f64> {
            joints.iter().map(|joint| of(joint)[0]).collect()
        };
        let q = first(|joint| &joint.position);
        let v = first(|joint| &joint.velocity);
        ClosedLoop::new((arm, drives), (model, &servos))
            .positions(&q, &v, &commands)
            .ok_or_else(|| "the simulated arm does not follow the commands".to_owned())
    };
    let (before, after) = (run(model, &before)?, run(&after.0, &after.1)?);
    let of = |(j, joint): (usize, &JointPicture)| {
        let column = |all: &[f64]| all.iter().skip(j).step_by(n).copied().collect();
        RolloutJoint {
            joint: joint.joint.clone(),
            slides: model.joints()[j].slides(),
            measured: joint.position.clone(),
            before: column(&before),
            after: column(&after),
        }
    };
    let rollout = Rollout {
        recording: picture.recording.clone(),
        time_s: time_s.to_vec(),
        joints: joints.iter().enumerate().map(of).collect(),
    };
    let worst = rollout.joints.iter().map(|joint| joint.rms(&joint.before));
    if worst.fold(0.0, f64::max) > LARGEST {
        return Err("the simulated arm does not follow the commands".to_owned());
    }
    Ok(rollout)
}

/// The controller of each joint.
fn servos(
    model: &Model,
    joints: &[JointPicture],
    commands: &Commands<'_>,
) -> Result<Vec<Servo>, String> {
    let rows = joints[0].time_s.len();
    let mut data = Data::new(model);
    let mut gravity = vec![vec![0.0; rows]; joints.len()];
    for k in 0..rows {
        let q: Vec<f64> = joints.iter().map(|joint| joint.position[k]).collect();
        let effort = gravity_effort(model, &mut data, &q);
        gravity.iter_mut().zip(effort).for_each(|(g, x)| g[k] = *x);
    }
    let of = |(j, joint): (usize, &JointPicture)| {
        let observed = Observed {
            time_s: &joint.time_s,
            position: &joint.position,
            velocity: &joint.velocity,
            effort: &joint.measured,
            gravity: &gravity[j],
        };
        let fitted = Servo::fitted(&observed, commands, j);
        let servo = fitted.filter(|(_, explained)| *explained >= LEAST_EXPLAINED);
        servo.map(|(servo, _)| servo).ok_or_else(|| {
            format!(
                "no gains of a controller explain the effort of {}",
                joint.joint
            )
        })
    };
    joints.iter().enumerate().map(of).collect()
}

impl Rollout {
    /// Its errors, for programs.
    pub fn errors(&self) -> Simulated {
        let of = |of: fn(&RolloutJoint) -> &[f64]| {
            let joints = self.joints.iter();
            joints.map(|joint| joint.rms(of(joint))).collect()
        };
        Simulated {
            recording: self.recording.clone(),
            rms_before: of(|joint| &joint.before),
            rms_after: of(|joint| &joint.after),
        }
    }
}

impl RolloutJoint {
    /// Root mean square of a simulated position less the measured one \[rad or m\].
    pub fn rms(&self, simulated: &[f64]) -> f64 {
        let squares = simulated
            .iter()
            .zip(&self.measured)
            .map(|(s, m)| (s - m).powi(2));
        (squares.sum::<f64>() / self.measured.len() as f64).sqrt()
    }

    /// Unit of the page and its size in SI units.
    fn unit(&self) -> (&'static str, f64) {
        if self.slides {
            ("mm", 1e-3)
        } else {
            ("mrad", 1e-3)
        }
    }

    /// Simulated less measured position in the unit of the page.
    fn deviation(&self, simulated: &[f64]) -> Vec<f64> {
        let (_, unit) = self.unit();
        let pairs = simulated.iter().zip(&self.measured);
        pairs.map(|(s, m)| (s - m) / unit).collect()
    }
}

/// The section of the page.
pub(super) fn section(rollout: &Rollout) -> Markup {
    let mut order: Vec<&RolloutJoint> = rollout.joints.iter().collect();
    order.sort_by(|a, b| b.rms(&b.before).total_cmp(&a.rms(&a.before)));
    html! {
        p.lead {
            "The simulated arm under the commands of " (rollout.recording)
            ", with a controller whose gains were fitted to the recorded efforts: how far its joints are from the measured ones."
        }
        p.legend {
            span.key.before { "Model as it was" }
            span.key.after { "Corrected model" }
        }
        @for joint in order.iter().take(DRAWN) { (over_time(rollout, joint)) }
        table.proof {
            thead { tr { th { "Joint" } th { "Unit" } th.num { "RMS before" } th.num { "RMS after" } } }
            tbody {
                @for joint in &rollout.joints {
                    @let (unit, size) = joint.unit();
                    tr {
                        th scope="row" { (joint.joint) }
                        td { (unit) }
                        td.num { (number_text(joint.rms(&joint.before) / size)) }
                        td.num { b { (number_text(joint.rms(&joint.after) / size)) } }
                    }
                }
            }
        }
    }
}

/// Deviations of a joint over time.
fn over_time(rollout: &Rollout, joint: &RolloutJoint) -> Markup {
    let [before, after] = [&joint.before, &joint.after].map(|all| joint.deviation(all));
    let both = before.iter().chain(&after).copied().chain([0.0]);
    let axes = (
        Axis::over(rollout.time_s.iter().copied(), 66.0, 950.0),
        Axis::over(both, 216.0, 26.0),
    );
    let (Some(x), Some(y)) = axes else {
        return html! {};
    };
    let panel = Panel {
        x,
        y: y.padded(0.05),
    };
    let name = format!(
        "{}: simulated − measured position [{}]",
        joint.joint,
        joint.unit().0
    );
    html! {
        figure {
            svg.plot viewBox=(format!("0 0 960 {}", r(256.0))) role="img" aria-label=(name) {
                (panel.frame(10, 5, Some("Time [s]"), &name))
                (panel.line("line before", &rollout.time_s, &before))
                (panel.line("line after", &rollout.time_s, &after))
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod tests {
    use super::*;
    use crate::models::JointCorrections;

    const ARM: &str = r#"<robot name="pendulum"><link name="base"/>
        <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
        <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/>
        <axis xyz="1 0 0"/></joint></robot>"#;

    /// A pendulum with 3 N m of dry friction and 2 N m s/rad that its model lacks follows a sine.
    fn recorded(corrections: &Corrections) -> (Model, RecordingPicture, Vec<f64>) {
        let model = Model::from_urdf(ARM).unwrap();
        let time_s: Vec<f64> = (0..1500).map(|k| 0.005 * f64::from(k)).collect();
        let commands: Vec<f64> = time_s.iter().map(|t| 0.8 * (2.0 * t).sin()).collect();
        let servo = Servo {
            position: 200.0,
            velocity: 20.0,
            share: 1.0,
            ..Servo::default()
        };
        let (arm, drives) = corrections.applied(&model);
        let servos = [servo];
        let position = ClosedLoop::new((&arm, &drives), (&model, &servos))
            .positions(&[0.0], &[0.0], &Commands::new(&model, &time_s, &commands))
            .unwrap();
        let mut velocity: Vec<f64> = position.windows(2).map(|p| (p[1] - p[0]) / 0.005).collect();
        velocity.insert(0, 0.0);
        let mut data = Data::new(&model);
        let measured = (0..position.len())
            .map(|k| {
                let gravity = gravity_effort(&model, &mut data, &[position[k]])[0];
                200.0 * (commands[k] - position[k]) - 20.0 * velocity[k] + gravity
            })
            .collect();
        let joint = JointPicture {
            joint: "hinge".to_owned(),
            time_s,
            position,
            velocity,
            measured,
            before: Vec::new(),
            after: Vec::new(),
        };
        let picture = RecordingPicture {
            recording: "held_out".to_owned(),
            held_out: true,
            start_ns: 0,
            joints: vec![joint],
        };
        (model, picture, commands)
    }

    fn corrections() -> Corrections {
        let hinge = JointCorrections {
            friction: Some(3.0),
            damping: Some(2.0),
            ..JointCorrections::default()
        };
        Corrections {
            joints: [("hinge".to_owned(), hinge)].into(),
            ..Corrections::default()
        }
    }

    #[test]
    fn the_corrected_arm_follows_the_measured_one() {
        let (model, picture, commands) = recorded(&corrections());
        let rollout = simulated(&model, &corrections(), &picture, &commands).unwrap();
        let joint = &rollout.joints[0];
        let (before, after) = (joint.rms(&joint.before), joint.rms(&joint.after));
        assert!(before > 5e-3 && after < 0.05 * before, "{before} {after}");
        let page = section(&rollout).into_string();
        assert!(page.contains("hinge") && page.contains("mrad"), "{page}");
    }

    #[test]
    fn efforts_that_no_controller_explains_are_not_simulated() {
        let (model, mut picture, commands) = recorded(&corrections());
        let efforts = picture.joints[0].measured.iter_mut().enumerate();
        efforts.for_each(|(k, effort)| *effort = ((k * k) as f64).sin());
        let why = simulated(&model, &corrections(), &picture, &commands).unwrap_err();
        assert!(why.contains("the effort of hinge"), "{why}");
    }
}
