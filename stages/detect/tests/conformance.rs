//! Conformance tests for every detector of the table.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common;

use std::sync::{Arc, OnceLock};

use common::Out;
use common::counting::{self, Nowhere};
use tauscope_bus::{Detection, Stage, StageError, TwinState, flags};
use tauscope_detect::{
    Config, ContactKind, DETECTORS, Detect, Entry, JointSetup, LabelledContact, Lesson, Lessons,
    Setup, Task, Threshold,
};
use tauscope_dynamics::{Data, Model, forward_kinematics, point_jacobian};

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

/// Sample rate \[Hz\].
const RATE_HZ: i64 = 500;
const STEP_NS: i64 = 1_000_000_000 / RATE_HZ;
/// Two joints in a row, axes z and y.
const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0.1 0 0.2"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  JOINTS
</robot>"#;
const JOINTS: [&str; 2] = [
    r#"<joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>"#,
    r#"<joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="tool"/><axis xyz="0 1 0"/></joint>"#,
];

/// Returns a cell with the arm's joints in the order a, b, or reversed.
fn setup(turned: bool) -> Setup {
    let order = if turned { [1, 0] } else { [0, 1] };
    let joints: String = order.map(|joint| JOINTS[joint]).concat();
    let model = Model::from_urdf(&ARM.replace("JOINTS", &joints)).unwrap();
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint; 2],
        joint_names: model.joint_names().map(str::to_owned).collect(),
        tool_link: model.link_index("tool"),
        contact_point_on_tool_m: Some([0.1, 0.0, 0.3]),
        model: Some(model),
        ..Setup::default()
    }
}

/// Returns samples of a swinging arm with little noise, from sample `from` on. If `touched`, there is a contact on
/// the tool for 0.3 s of every 2 s, alternately against the motion of joint a and along with it.
fn swing(setup: &Setup, from: i64, samples: i64, touched: bool) -> Vec<TwinState> {
    let model = setup.model.as_ref().unwrap();
    let mut data = Data::new(model);
    let tool = setup.tool_link.unwrap();
    let place = ["a", "b"].map(|name| model.joint_index(name).unwrap());
    let sample = |k: i64| {
        let mut sample = TwinState::default();
        sample.header.stamp_ns = k * STEP_NS;
        sample.header.flags = flags::READY;
        sample.header.joint_count = 2;
        let t = k as f64 / RATE_HZ as f64;
        for (joint, j) in place.into_iter().enumerate() {
            let pace = 1.7 + 0.9 * joint as f64;
            let (sin, cos) = (pace * t).sin_cos();
            sample.position[j] = 0.6 + 0.4 * sin;
            sample.velocity[j] = 0.4 * pace * cos;
            sample.acceleration[j] = -0.4 * pace * pace * sin;
            sample.expected_effort[j] = sin;
            // Sines of incommensurable frequencies.
            let noise = (0..5).map(|i| (17.3 * (i + 2) as f64 * t + (7 * joint + i) as f64).sin());
            sample.effort[j] = sin + 0.05 * noise.sum::<f64>();
        }
        if touched && in_contact(k) {
            forward_kinematics(model, &mut data, &sample.position[..2]);
            let sense = if (k / (2 * RATE_HZ)) % 2 == 0 {
                -1.0
            } else {
                1.0
            };
            let force_n = 25.0 * sense * sample.velocity[place[0]].signum();
            point_jacobian(
                model,
                &data,
                tool,
                &[0.1, 0.0, 0.3].into(),
                |j, linear, _| {
                    sample.effort[j] -= force_n * (linear.y + 0.5 * linear.x);
                },
            );
        }
        for j in 0..2 {
            sample.residual[j] = sample.effort[j] - sample.expected_effort[j];
        }
        sample.filtered_effort = sample.effort;
        sample.filtered_expected_effort = sample.expected_effort;
        sample
    };
    (from..from + samples).map(sample).collect()
}

fn in_contact(k: i64) -> bool {
    let within = k % (2 * RATE_HZ);
    (RATE_HZ..RATE_HZ + 3 * RATE_HZ / 10).contains(&within)
}

fn labels(samples: &[TwinState]) -> Vec<LabelledContact> {
    let on = |pair: &&[TwinState]| {
        let [before, now] = [0, 1].map(|i| in_contact(pair[i].header.stamp_ns / STEP_NS));
        !before && now
    };
    let contact = |pair: &[TwinState]| {
        let on_ns = pair[1].header.stamp_ns;
        let kind = if (on_ns / STEP_NS / (2 * RATE_HZ)) % 2 == 0 {
            ContactKind::Collision
        } else {
            ContactKind::Cooperation
        };
        LabelledContact {
            on_ns,
            off_ns: on_ns + 300_000_000,
            kind,
            ignore: false,
        }
    };
    samples.windows(2).filter(on).map(contact).collect()
}

/// A learnt detector that can be built repeatedly.
struct Pupil {
    entry: &'static Entry,
    config: Config,
    setup: Setup,
}

impl Pupil {
    /// Trains a detector in a cell, with a short training.
    fn of(entry: &'static Entry, setup: &Setup) -> Self {
        let lesson = |name: &str, from: i64, touched: bool| {
            let samples = swing(setup, from, 24 * RATE_HZ, touched);
            let contacts = Some(if touched {
                labels(&samples)
            } else {
                Vec::new()
            });
            Lesson {
                name: name.to_owned(),
                samples,
                contacts,
            }
        };
        let (train, validation) = ([lesson("touched", 0, true)], [lesson("free", 77, false)]);
        let task = Task {
            setup,
            lessons: Lessons {
                train: &train,
                validation: &validation,
            },
            free_first_s: 0.0,
            seed: 1,
        };
        let (settings, trained) = quick(entry).learn(&task).unwrap();
        let mut setup = setup.clone();
        if let Some(trained) = trained {
            setup
                .trained
                .insert(entry.name.to_owned(), Arc::new(trained));
        }
        let mut config = Config::default().with_any(settings);
        if config.detector(&setup).unwrap().threshold().is_none() {
            config.threshold = Threshold {
                score: Some(0.5),
                sigmas: None,
            };
        }
        Self {
            entry,
            config,
            setup,
        }
    }

    fn stage(&self) -> Detect {
        self.config.stage(self.setup.clone()).unwrap()
    }

    fn run(&self, samples: &[TwinState]) -> Result<Vec<Detection>, StageError> {
        run(&mut self.stage(), samples)
    }
}

/// Returns the default settings of a detector, with a shorter training.
fn quick(entry: &Entry) -> Box<dyn tauscope_detect::AnySettings> {
    let usual = Config::default().with_any((entry.settings)());
    let mut file = serde_json::to_value(&usual).unwrap();
    let settings = file[entry.name].as_object_mut().unwrap();
    let mut make = |key: &str, value: serde_json::Value| {
        settings.entry(key).and_modify(|own| *own = value);
    };
    make("training", serde_json::json!({"epochs": 1}));
    make("layers", serde_json::json!([3]));
    make("hidden", 3.into());
    make("sequence", 20.into());
    make("stride", 20.into());
    let config: Config = serde_json::from_value(file).unwrap();
    config.given(entry).unwrap().boxed()
}

fn run(stage: &mut Detect, samples: &[TwinState]) -> Result<Vec<Detection>, StageError> {
    let mut out = Out::default();
    samples
        .iter()
        .try_for_each(|sample| stage.accept(sample, &mut out))?;
    Ok(out.0)
}

/// Returns every detector of the table, trained.
fn pupils() -> &'static [Pupil] {
    static PUPILS: OnceLock<Vec<Pupil>> = OnceLock::new();
    PUPILS.get_or_init(|| {
        let all = DETECTORS.iter();
        all.map(|entry| Pupil::of(entry, &setup(false))).collect()
    })
}

/// Returns the contents of the detections for comparison bit for bit.
fn said(detections: &[Detection]) -> Vec<(u64, String, u32, i64, String, [u64; 3])> {
    let bits = |of: &Detection| {
        let state = of.state.as_str().to_owned();
        let link = of.link.as_str().to_owned();
        let force = of.force_n.map(f64::to_bits);
        (
            of.score.to_bits(),
            state,
            of.joints,
            of.contact_ns,
            link,
            force,
        )
    };
    detections.iter().map(bits).collect()
}

#[test]
fn the_same_samples_twice_give_the_same_output_and_contacts_are_found() {
    let samples = swing(&setup(false), 0, 10 * RATE_HZ, true);
    for pupil in pupils() {
        let first = pupil.run(&samples).unwrap();
        assert_eq!(
            first.len(),
            samples.len(),
            "{}: one a sample",
            pupil.entry.name
        );
        assert_eq!(
            said(&first),
            said(&pupil.run(&samples).unwrap()),
            "{}",
            pupil.entry.name
        );
        let ready = first.iter().filter(|of| of.header.has(flags::READY));
        assert!(ready.count() > samples.len() / 2, "{}", pupil.entry.name);
    }
}

#[test]
fn a_reset_begins_anew() {
    let own = setup(false);
    let before = swing(&own, 0, 3 * RATE_HZ, true);
    let mut after = swing(&own, 20 * RATE_HZ, 5 * RATE_HZ, true);
    after[0].header.flags |= flags::RESET;
    for pupil in pupils() {
        if pupil.entry.name == "virtual_collision_sensor" {
            // Its learnt state survives a reset.
            continue;
        }
        let mut stage = pupil.stage();
        run(&mut stage, &before).unwrap();
        let goes_on = run(&mut stage, &after).unwrap();
        let alone = pupil.run(&after).unwrap();
        for (k, (one, other)) in goes_on.iter().zip(&alone).enumerate() {
            let name = pupil.entry.name;
            assert_eq!(
                one.header.has(flags::READY),
                other.header.has(flags::READY),
                "{name} at {k}"
            );
            if one.header.has(flags::READY) {
                let close = (one.score - other.score).abs() <= 1e-6 * other.score.abs().max(1.0);
                assert!(close, "{name} at {k}: {} {}", one.score, other.score);
            }
        }
    }
}

#[test]
fn behind_a_gap_every_score_is_finite_again() {
    let own = setup(false);
    let mut samples = swing(&own, 0, 3 * RATE_HZ, false);
    samples.extend(swing(&own, 8 * RATE_HZ, 3 * RATE_HZ, false));
    for pupil in pupils() {
        let said = pupil.run(&samples).unwrap();
        let late = &said[said.len() - 100..];
        assert!(
            late.iter().all(|of| of.score.is_finite()),
            "{}",
            pupil.entry.name
        );
        assert!(
            late.iter().all(|of| of.header.has(flags::READY)),
            "{}",
            pupil.entry.name
        );
    }
}

#[test]
fn a_reading_that_is_no_number_costs_its_sample_alone() {
    // Ingest drops such samples; a stage must tolerate one nevertheless.
    let own = setup(false);
    let mut samples = swing(&own, 0, 4 * RATE_HZ, false);
    samples[1200].effort[1] = f64::NAN;
    samples[1200].filtered_effort[1] = f64::NAN;
    samples[1200].residual[1] = f64::INFINITY;
    for pupil in pupils() {
        let said = pupil.run(&samples).unwrap();
        assert!(!said[1200].header.has(flags::READY), "{}", pupil.entry.name);
        let late = &said[1201..];
        assert!(
            late.iter().all(|of| of.score.is_finite()),
            "{}",
            pupil.entry.name
        );
    }
}

#[test]
fn at_another_rate_a_detector_judges_on_or_says_why_it_cannot() {
    let own = setup(false);
    let half: Vec<TwinState> = swing(&own, 0, 10 * RATE_HZ, true)
        .into_iter()
        .step_by(2)
        .collect();
    for pupil in pupils() {
        match pupil.run(&half) {
            Ok(said) => assert!(
                said.iter().all(|of| of.score.is_finite()),
                "{}",
                pupil.entry.name
            ),
            Err(StageError::Unfit(reason)) => {
                assert!(reason.starts_with(pupil.entry.name), "{reason}");
                assert!(
                    reason.contains("samples a second") || reason.contains("Hz"),
                    "{reason}"
                );
            }
            Err(other) => panic!("{}: {other}", pupil.entry.name),
        }
    }
}

#[test]
fn joints_in_another_order_give_the_same_scores() {
    let turned = setup(true);
    let (samples, others) = (
        swing(&setup(false), 0, 4 * RATE_HZ, true),
        swing(&turned, 0, 4 * RATE_HZ, true),
    );
    for pupil in pupils() {
        if pupil.entry.random {
            // Its initial weights are random and depend on the joint order.
            continue;
        }
        let other = Pupil::of(pupil.entry, &turned);
        let (one, other) = (pupil.run(&samples).unwrap(), other.run(&others).unwrap());
        for (k, (one, other)) in one.iter().zip(&other).enumerate() {
            let close = (one.score - other.score).abs() <= 1e-3 * one.score.abs().max(1.0);
            assert!(
                close,
                "{} at {k}: {} {}",
                pupil.entry.name, one.score, other.score
            );
        }
    }
}

#[test]
fn nothing_is_allocated_per_sample() {
    let samples = swing(&setup(false), 0, 8 * RATE_HZ, true);
    // After this time every window is full and the band's bins are known.
    let (warm, rest) = samples.split_at(3 * RATE_HZ as usize);
    for pupil in pupils() {
        let mut stage = pupil.stage();
        for sample in warm {
            stage.accept(sample, &mut Nowhere).unwrap();
        }
        let before = counting::allocations();
        for sample in rest {
            stage.accept(sample, &mut Nowhere).unwrap();
        }
        assert_eq!(counting::allocations(), before, "{}", pupil.entry.name);
    }
}

#[test]
fn a_file_gives_back_what_was_written_to_it() {
    for pupil in pupils() {
        let text = serde_json::to_string(&pupil.config).unwrap();
        let config: Config = serde_json::from_str(&text).unwrap();
        assert_eq!(config, pupil.config, "{text}");
        assert_eq!(config.name(), Some(pupil.entry.name));
    }
}
