//! Planning of a recording before its simulation.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::MAX_JOINTS;
use tauscope_dynamics::{Data, Inertia, Model, forward_kinematics, link_pose};

use super::error::ScenarioError;
use super::push::find_link;
use super::scenario::{RecordedMotionSpec, RecordingSpec, Scenario};
use super::trajectory::{Allowed, Fourier, JointRange, Points, Spline, Trajectory};
use crate::config::{Config, CsvConfig, FileConfig, Topics};
use crate::recorded::RecordedSource;
use crate::setup::Setup;

/// Integration step of the plant \[ns\].
/// Resolution: balances the integration error against the computing time.
pub(super) const STEP_NS: i64 = 250_000;
/// Pause between two recordings of a session \[ns\].
/// Chosen: for simulated cells only; long enough for recordings to be separate, short against drift of a session.
const PAUSE_NS: i64 = 10_000_000_000;
/// Range in either direction of a joint without position limits \[rad\].
/// Physical: half a turn.
const FREE_RANGE: f64 = std::f64::consts::PI;
/// Highest velocity of a joint without a velocity limit \[rad/s\].
/// Physical: about the joint speed limit of common arms, 2 to 3 rad/s.
const FREE_VELOCITY: f64 = 2.0;
/// Number of random streams per recording.
/// Resolution: at least the number of streams requested from [`random`].
const STREAMS: u64 = 8;

/// Returns the generator of a recording's random stream: 0 for its motion, 1 for its pushes, 2 for its sensors.
pub(super) fn random(scenario: &Scenario, index: usize, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    // Streams of their own: a change of the motion leaves the noise of the sensors as it was.
    rng.set_stream(index as u64 * STREAMS + stream);
    rng
}

/// Returns the start of a recording in its session \[ns\].
pub(super) fn offset_ns(scenario: &Scenario, index: usize) -> i64 {
    let before = scenario.recordings[..index].iter();
    before
        .map(|before| whole_steps(before.duration_s) * STEP_NS + PAUSE_NS)
        .sum()
}

/// Returns the number of steps of the plant in a duration.
pub(super) fn whole_steps(duration_s: f64) -> i64 {
    (duration_s * 1e9 / STEP_NS as f64).round() as i64
}

/// Returns the limits of the joints, with default ranges where the URDF gives none.
pub(super) fn joint_ranges(model: &Model) -> Result<Vec<JointRange>, ScenarioError> {
    if model.dof() > MAX_JOINTS {
        return Err(ScenarioError::TooManyJoints {
            found: model.dof(),
            limit: MAX_JOINTS,
        });
    }
    let ranges = model.joints().iter().map(|joint| {
        let limits = &joint.limits;
        JointRange {
            name: joint.name.clone(),
            lower: limits.lower.unwrap_or(-FREE_RANGE),
            upper: limits.upper.unwrap_or(FREE_RANGE),
            velocity: limits.velocity.unwrap_or(FREE_VELOCITY),
            effort: limits.effort.unwrap_or(f64::INFINITY),
        }
    });
    Ok(ranges.collect())
}

/// Returns the arm with the tool that its controller models.
pub(super) fn with_tool(scenario: &Scenario, model: &Model) -> Result<Model, ScenarioError> {
    let mut model = model.clone();
    if let Some(tool) = &scenario.tool {
        let link = find_link(&model, "the tool", &tool.link)?;
        let inertia = Inertia::new(tool.mass_kg, tool.com_m, tool.inertia_kgm2);
        model.set_tool(link, inertia);
    }
    Ok(model)
}

/// Returns the motion of a recording; `model` includes the tool.
pub(super) fn trajectory(
    spec: &RecordingSpec,
    model: &Model,
    joints: &[JointRange],
    rng: ChaCha8Rng,
) -> Result<Trajectory, ScenarioError> {
    let motion = &spec.motion;
    match (&motion.points, &motion.fourier, &motion.recorded) {
        (Some(points), None, None) => {
            let allowed = above(model.clone(), points.min_height_m);
            let points = Points::new(points, model, joints, allowed, rng)?;
            points.check_fit(&spec.name, spec.duration_s)?;
            Ok(Trajectory::Points(Box::new(points)))
        }
        (None, Some(fourier), None) => Ok(Trajectory::Fourier(Fourier::new(
            fourier,
            joints,
            spec.duration_s,
            rng,
        )?)),
        (None, None, Some(recorded)) => Ok(Trajectory::Spline(read_motion(recorded, joints)?)),
        (points, fourier, recorded) => Err(ScenarioError::OneMotion {
            recording: spec.name.clone(),
            found: usize::from(points.is_some())
                + usize::from(fourier.is_some())
                + usize::from(recorded.is_some()),
        }),
    }
}

/// Returns a predicate of positions that requires every moving link's frame to be high enough.
fn above(model: Model, min_height_m: Option<f64>) -> Allowed {
    let Some(least_m) = min_height_m else {
        return Box::new(|_| true);
    };
    let mut data = Data::new(&model);
    Box::new(move |position| {
        forward_kinematics(&model, &mut data, position);
        model
            .joints()
            .iter()
            .all(|joint| link_pose(&model, &data, joint.child_link).translation.z >= least_m)
    })
}

/// Reads the positions of a recording or table, at times relative to its first sample.
fn read_motion(
    recorded: &RecordedMotionSpec,
    joints: &[JointRange],
) -> Result<Spline, ScenarioError> {
    let setup = Setup {
        joint_names: joints.iter().map(|joint| joint.name.clone()).collect(),
        ..Setup::default()
    };
    let (path, config) = (recorded.path.clone(), Config::default());
    let source = if let Some(columns) = recorded.columns.clone() {
        RecordedSource::open_csv(&CsvConfig { path, columns }, &config, &setup)
    } else {
        let topics = Topics {
            state: recorded.topic.clone(),
            ..Topics::default()
        };
        RecordedSource::open_file(&FileConfig { path, topics }, &config, &setup)
    };
    let mut source = source.map_err(|error| ScenarioError::Motion(Box::new(error)))?;
    let (mut times_s, mut positions) = (Vec::new(), Vec::new());
    let mut first_ns = None;
    while let Some(sample) = source
        .next_packed()
        .map_err(|error| ScenarioError::Motion(Box::new(error)))?
    {
        let first_ns = *first_ns.get_or_insert(sample.header.stamp_ns);
        let time_s = (sample.header.stamp_ns - first_ns) as f64 * 1e-9;
        if times_s.last().is_none_or(|last| *last < time_s) {
            times_s.push(time_s);
            positions.push(sample.position);
        }
    }
    Ok(Spline::new(times_s, positions, joints.len()))
}
