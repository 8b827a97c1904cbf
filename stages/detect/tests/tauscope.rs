//! `tauscope`, our own detector: learns what is usual, and is raised by what is not.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{Detection, Emit, EventKind, LinkError, Stage, TwinState, flags};
use tauscope_detect::{
    Config, ConfigError, Detect, JointSetup, LabelledContact, LearnError, Lesson, Lessons, Setup,
    tauscope,
};

const JOINTS: usize = 3;
const STEP_NS: i64 = 10_000_000;

/// A minute of contact-free noise, twice as large where a joint is slow.
fn quiet(seed: u64, samples: i64) -> Vec<TwinState> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..samples)
        .map(|k| {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k * STEP_NS;
            sample.header.joint_count = JOINTS as u32;
            sample.header.flags = flags::READY;
            for j in 0..JOINTS {
                let speed = (0.01 * k as f64 + j as f64).sin();
                let noise = if speed.abs() < 0.1 { 0.2 } else { 0.1 };
                sample.velocity[j] = speed;
                // Sum of uniform numbers: nearly Gaussian.
                let sum: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                sample.effort[j] = noise * sum;
            }
            sample
        })
        .collect()
}

fn lesson(samples: Vec<TwinState>) -> Lesson {
    Lesson {
        name: "rec".to_owned(),
        samples,
        contacts: Some(Vec::new()),
    }
}

fn setup() -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint; JOINTS],
        ..Setup::default()
    }
}

fn learnt(settings: &tauscope::Settings) -> tauscope::Settings {
    let train = [lesson(quiet(1, 6000)), lesson(quiet(2, 6000))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    tauscope::learn(settings, &lessons).unwrap()
}

fn detector(settings: tauscope::Settings) -> Detect {
    let config = Config {
        tauscope: Some(settings),
        ..Config::default()
    };
    Detect::new(&config, setup()).unwrap()
}

#[derive(Default)]
struct Out(Vec<Detection>);

impl Emit<Detection> for Out {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let mut sample = Detection::default();
        write(&mut sample);
        self.0.push(sample);
        Ok(())
    }
}

fn run(detector: &mut Detect, samples: &[TwinState]) -> Vec<Detection> {
    let mut out = Out::default();
    for sample in samples {
        detector.accept(sample, &mut out).unwrap();
    }
    out.0
}

fn onsets(detections: &[Detection]) -> Vec<usize> {
    (0..detections.len())
        .filter(|&k| detections[k].event() == EventKind::Onset)
        .collect()
}

#[test]
fn a_contact_is_found_at_once_and_told_by_the_joint_that_felt_it() {
    let mut detector = detector(learnt(&tauscope::Settings::default()));
    let mut samples = quiet(3, 3000);
    for sample in &mut samples[1000..1050] {
        sample.effort[1] -= 1.5;
    }
    let detections = run(&mut detector, &samples);
    let onsets = onsets(&detections);
    assert_eq!(onsets.len(), 1, "{onsets:?}");
    assert!((1000..1005).contains(&onsets[0]), "{onsets:?}");
    assert_eq!(detections[onsets[0] + 3].joints, 0b010);
    // The longest window is empty of it after 100 ms; a usual peak may hold the alarm for as long again.
    assert!(!detections[1100].alarm());
}

#[test]
fn fewer_false_alarms_are_bought_with_a_higher_threshold() {
    let wish = |false_alarms_per_hour| tauscope::Settings {
        false_alarms_per_hour,
        ..tauscope::Settings::default()
    };
    let threshold = |settings| run(&mut detector(settings), &quiet(3, 20))[19].threshold;
    let often = threshold(learnt(&wish(60.0)));
    let weekly = threshold(learnt(&wish(0.006)));
    assert!(weekly > 1.5 * often, "{often} {weekly}");
}

#[test]
fn slow_drift_is_no_contact() {
    let mut detector = detector(learnt(&tauscope::Settings {
        false_alarms_per_hour: 0.1,
        ..tauscope::Settings::default()
    }));
    let mut samples = quiet(4, 12_000);
    for (k, sample) in samples.iter_mut().enumerate() {
        // As much as twice the noise, over two minutes.
        sample.effort[0] += 0.2 * k as f64 / 12_000.0;
    }
    assert!(onsets(&run(&mut detector, &samples)).is_empty());
}

#[test]
fn labelled_contacts_teach_nothing() {
    let mut touched = quiet(1, 6000);
    for sample in &mut touched[2000..2100] {
        sample.effort[0] += 5.0;
    }
    let mut lesson_ = lesson(touched);
    lesson_.contacts = Some(vec![LabelledContact {
        on_ns: 2000 * STEP_NS,
        off_ns: 2100 * STEP_NS,
        kind: tauscope_detect::ContactKind::Contact,
        ignore: false,
    }]);
    let train = [lesson_];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &lessons).unwrap();
    let noise = &learnt.learnt.unwrap().windows[0].noise[0];
    assert!(noise.iter().all(|noise| *noise < 0.3), "{noise:?}");
}

#[test]
fn too_short_a_lesson_says_how_much_is_wanted() {
    let train = [lesson(quiet(1, 100))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let error = tauscope::learn(&tauscope::Settings::default(), &lessons).unwrap_err();
    assert!(matches!(error, LearnError::TooLittle { .. }), "{error}");
}

#[test]
fn nothing_learnt_and_another_robot_are_refused() {
    let config = |settings| Config {
        tauscope: Some(settings),
        ..Config::default()
    };
    let bare = config(tauscope::Settings::default());
    let refused = |config: &Config, setup| Detect::new(config, setup).err().unwrap();
    assert!(matches!(
        refused(&bare, setup()),
        ConfigError::NotLearnt { .. }
    ));
    let mut other = setup();
    other.joints.pop();
    let learnt = config(learnt(&tauscope::Settings::default()));
    assert!(matches!(
        refused(&learnt, other),
        ConfigError::LearntState { .. }
    ));
}

#[test]
fn a_reset_forgets_what_was_before() {
    let mut detector = detector(learnt(&tauscope::Settings::default()));
    let mut samples = quiet(3, 40);
    samples[20].header.flags |= flags::RESET;
    let detections = run(&mut detector, &samples);
    assert!(detections[19].header.has(flags::READY));
    assert!(!detections[20].header.has(flags::READY));
    assert!(detections[35].header.has(flags::READY));
}
