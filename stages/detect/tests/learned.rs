//! The learned detectors: trained on a contact-free arm, they detect a push, and their files can be saved and loaded.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use tauscope_bus::{Header, TwinState, flags};
use tauscope_detect::tajiri::learned::TrainingSettings;
use tauscope_detect::tajiri::{
    lstm_momentum_observer, point_autoencoder, point_ocsvm, window_autoencoder, window_ocsvm,
};
use tauscope_detect::{
    AnySettings, ConfigError, ContactKind, Detector, JointSetup, LabelledContact, LearnError,
    Lesson, Lessons, Setup, Task, Trained, TrainedError,
};
use tauscope_dynamics::Model;

/// Planar arm with two parallel joint axes.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>"#;

fn setup_of(urdf: &str) -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: None,
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint; 2],
        model: Some(Model::from_urdf(urdf).unwrap()),
        ..Setup::default()
    }
}

fn setup() -> Setup {
    setup_of(ARM)
}

/// Returns samples at 100 Hz of a swinging arm with friction that its twin does not model. A contact pushes joint b
/// with `push` \[N m\] from sample 900 to 930.
fn swing(samples: i64, phase: f64, push: f64) -> Vec<TwinState> {
    let state = |i: i64| {
        let t = i as f64 * 0.01;
        let mut sample = TwinState {
            header: Header {
                stamp_ns: 10_000_000 * (i + 1),
                flags: flags::READY | if i == 0 { flags::RESET } else { 0 },
                joint_count: 2,
                ..Header::default()
            },
            ..TwinState::default()
        };
        for (j, pace) in [1.3, 2.1].into_iter().enumerate() {
            let (sin, cos) = (pace * t + phase + j as f64).sin_cos();
            sample.position[j] = 0.5 * sin;
            sample.velocity[j] = 0.5 * pace * cos;
            sample.acceleration[j] = -0.5 * pace * pace * sin;
            sample.effort[j] = 1.5 * (sample.velocity[j] / 0.1).tanh();
        }
        if (900..=930).contains(&i) {
            sample.effort[1] -= push;
        }
        sample
    };
    (0..samples).map(state).collect()
}

fn lesson(samples: Vec<TwinState>, contacts: &[(i64, i64)]) -> Lesson {
    let contact = |&(on, off): &(i64, i64)| LabelledContact {
        on_ns: 10_000_000 * (on + 1),
        off_ns: 10_000_000 * (off + 1),
        kind: ContactKind::Contact,
        ignore: false,
    };
    Lesson {
        name: "swing".to_owned(),
        samples,
        contacts: Some(contacts.iter().map(contact).collect()),
    }
}

fn lessons() -> (Vec<Lesson>, Vec<Lesson>) {
    let free = |phase| lesson(swing(1200, phase, 0.0), &[]);
    (vec![free(0.0), free(1.0)], vec![free(0.5)])
}

fn quick(epochs: usize, batch: usize) -> TrainingSettings {
    TrainingSettings {
        epochs,
        batch,
        dropout: 0.0,
        learning_rate: 5e-3,
    }
}

/// Returns every learned detector with settings for a short training, and the number of samples behind its score.
fn detectors() -> [(usize, Box<dyn AnySettings>); 5] {
    [
        (1, Box::new(point_ocsvm::Settings::default())),
        (16, Box::new(window_ocsvm::Settings::default())),
        (
            1,
            Box::new(point_autoencoder::Settings {
                layers: vec![6, 1, 6],
                training: quick(20, 100),
                ..point_autoencoder::Settings::default()
            }),
        ),
        (
            16,
            Box::new(window_autoencoder::Settings {
                stride: 4,
                training: quick(20, 20),
                ..window_autoencoder::Settings::default()
            }),
        ),
        (
            20,
            Box::new(lstm_momentum_observer::Settings {
                sequence: 20,
                hidden: 12,
                training: quick(15, 200),
                ..lstm_momentum_observer::Settings::default()
            }),
        ),
    ]
}

/// Trains a detector.
fn train(
    settings: &dyn AnySettings,
    setup: &Setup,
    lessons: &Lessons<'_>,
    seed: u64,
) -> Result<Trained, LearnError> {
    let task = Task {
        setup,
        lessons: *lessons,
        free_first_s: 0.0,
        seed,
    };
    Ok(settings.learn(&task)?.1.unwrap())
}

/// Returns every detector of [`detectors`], trained with seed 1.
fn trained() -> &'static BTreeMap<&'static str, Trained> {
    static TRAINED: OnceLock<BTreeMap<&'static str, Trained>> = OnceLock::new();
    TRAINED.get_or_init(|| {
        let (training, validation) = lessons();
        let lessons = Lessons {
            train: &training,
            validation: &validation,
        };
        let all = detectors().into_iter();
        all.map(|(_, settings)| {
            let trained = train(&*settings, &setup(), &lessons, 1).unwrap();
            (settings.name(), trained)
        })
        .collect()
    })
}

fn with(name: &str, trained: Trained) -> Setup {
    Setup {
        trained: BTreeMap::from([(name.to_owned(), Arc::new(trained))]),
        ..setup()
    }
}

fn scores(detector: &mut dyn Detector, samples: &[TwinState]) -> Vec<Option<f64>> {
    let judge = |sample| {
        let judgement = detector.judge(sample);
        judgement.ready.then_some(judgement.score)
    };
    samples.iter().map(judge).collect()
}

#[test]
fn a_push_stands_out_from_what_was_learnt() {
    for (_, settings) in detectors() {
        let name = settings.name();
        let trained = trained()[name].clone();
        let free = trained.score();
        let mut detector = settings.build(&with(name, trained), 0.1).unwrap();
        let scores = scores(detector.as_mut(), &swing(1200, 0.2, 4.0));
        let during = scores[900..=940].iter().flatten();
        let pushed = during.fold(f64::MIN, |most, &score| most.max(score));
        let threshold = free.mean + 2.0 * free.standard_deviation;
        assert!(pushed > threshold, "{name}: {pushed} above {threshold}");
        let before = scores[200..890].iter().flatten();
        let false_alarms = before.filter(|score| **score > threshold).count();
        assert!(false_alarms < 70, "{name}: {false_alarms} of 690");
    }
}

#[test]
fn a_detector_that_was_kept_scores_as_before_bit_for_bit() {
    let samples = swing(1000, 0.2, 4.0);
    for (_, settings) in detectors() {
        let name = settings.name();
        let mut trained = trained()[name].clone();
        let provenance = trained.provenance_mut();
        provenance.insert("recording".to_owned(), "swing".to_owned());
        let kept = Trained::from_bytes(&trained.to_bytes().unwrap()).unwrap();
        assert!(kept == trained, "{name}");
        assert!(kept.to_bytes() == trained.to_bytes(), "{name}");
        let run = |trained| {
            let mut detector = settings.build(&with(name, trained), 0.1).unwrap();
            scores(detector.as_mut(), &samples)
        };
        let (before, after) = (run(trained), run(kept));
        let bits = |scores: &[Option<f64>]| -> Vec<_> {
            scores.iter().map(|s| s.map(f64::to_bits)).collect()
        };
        assert_eq!(bits(&before), bits(&after), "{name}");
        assert!(before.iter().flatten().count() > 900, "{name}");
    }
}

#[test]
fn the_same_seed_trains_the_same_detector() {
    let (training, validation) = lessons();
    let lessons = Lessons {
        train: &training,
        validation: &validation,
    };
    for (_, settings) in detectors() {
        let name = settings.name();
        let trained_with = |seed| train(&*settings, &setup(), &lessons, seed).unwrap();
        let bytes = |seed| trained_with(seed).to_bytes().unwrap();
        let first = trained()[name].to_bytes().unwrap();
        assert!(first == bytes(1), "{name}");
        assert!(first != bytes(2), "{name}");
    }
}

#[test]
fn a_score_waits_for_its_window_and_a_reset_empties_it() {
    for (window, settings) in detectors() {
        let name = settings.name();
        let trained = trained()[name].clone();
        let mut detector = settings.build(&with(name, trained), 0.1).unwrap();
        let mut samples = swing(400, 0.2, 0.0);
        samples[200].header.flags |= flags::RESET;
        let scores = scores(detector.as_mut(), &samples);
        let first = scores.iter().position(Option::is_some).unwrap();
        // The low-pass settles, and then the window fills.
        assert!(first > 20 && first >= window, "{name}: {first}");
        let again = scores[200..].iter().position(Option::is_some).unwrap();
        assert_eq!(again, first, "{name}");
    }
}

#[test]
fn what_was_touched_is_not_learnt() {
    let contacts = [(900, 930)];
    let pushed = |push| {
        let training = [lesson(swing(1200, 0.0, push), &contacts)];
        let lessons = Lessons {
            train: &training,
            validation: &[],
        };
        let settings = window_ocsvm::Settings::default();
        train(&settings, &setup(), &lessons, 1).unwrap()
    };
    assert!(pushed(4.0).facts().samples < 1160);
    assert_eq!(pushed(4.0).facts().samples, pushed(0.0).facts().samples);
}

#[test]
fn another_robots_detector_is_refused_and_both_robots_joints_are_named() {
    let (training, validation) = lessons();
    let lessons = Lessons {
        train: &training,
        validation: &validation,
    };
    let settings = window_ocsvm::Settings::default();
    let other = setup_of(&ARM.replace("name=\"b\"", "name=\"elbow\""));
    let trained = train(&settings, &other, &lessons, 1).unwrap();
    let Err(error) = settings.build(&with("window_ocsvm", trained), 0.1) else {
        panic!("a detector for other joints was taken");
    };
    let text = error.to_string();
    assert!(text.contains("a, elbow") && text.contains("a, b"), "{text}");
}

#[test]
fn a_detector_without_its_training_says_so() {
    for (_, settings) in detectors() {
        let name = settings.name();
        assert_eq!(
            settings.build(&setup(), 0.1).err(),
            Some(ConfigError::NotTrained { detector: name })
        );
    }
}

#[test]
fn a_file_that_is_no_trained_detector_is_told_from_a_damaged_one() {
    assert!(matches!(
        Trained::from_bytes(b"joints: [a, b]"),
        Err(TrainedError::Format { .. })
    ));
    let (training, _) = lessons();
    let lessons = Lessons {
        train: &training,
        validation: &[],
    };
    let settings = window_ocsvm::Settings::default();
    let trained = train(&settings, &setup(), &lessons, 1).unwrap();
    let bytes = trained.to_bytes().unwrap();
    assert!(Trained::from_bytes(&bytes[..bytes.len() - 8]).is_err());
    let at = bytes
        .windows(8)
        .position(|part| part == b"tauscope")
        .unwrap();
    let mut foreign = bytes;
    foreign[at..at + 8].copy_from_slice(b"somebody");
    assert!(matches!(
        Trained::from_bytes(&foreign),
        Err(TrainedError::Facts { .. })
    ));
}

#[test]
fn too_little_to_learn_from_is_an_error_that_says_how_much_is_wanted() {
    let training = [lesson(swing(10, 0.0, 0.0), &[])];
    let lessons = Lessons {
        train: &training,
        validation: &[],
    };
    for (_, settings) in detectors() {
        let name = settings.name();
        let error = train(&*settings, &setup(), &lessons, 1).unwrap_err();
        assert!(
            matches!(error, LearnError::TooLittle { .. }),
            "{name}: {error}"
        );
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let (training, _) = lessons();
    let lessons = Lessons {
        train: &training,
        validation: &[],
    };
    let settings = window_ocsvm::Settings {
        stride: 0,
        ..window_ocsvm::Settings::default()
    };
    let error = train(&settings, &setup(), &lessons, 1).unwrap_err();
    assert!(error.to_string().contains("`stride`"), "{error}");
    let settings = point_autoencoder::Settings {
        layers: vec![5, 0, 5],
        ..point_autoencoder::Settings::default()
    };
    let error = train(&settings, &setup(), &lessons, 1).unwrap_err();
    assert!(error.to_string().contains("`layers`"), "{error}");
}
