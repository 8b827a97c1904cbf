//! `tauscope`, the project's own detector: learns the baseline, and raises an alarm for deviations from it.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::{Out, setup};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{Detection, EventKind, Stage, TwinState, flags};
use tauscope_detect::{
    Config, ConfigError, ContactKind, Detect, LabelledContact, LearnError, Lesson, Lessons, Setup,
    tauscope,
};
use tauscope_dynamics::{Data, Model, forward_kinematics, point_jacobian};

const JOINTS: usize = 3;
const STEP_NS: i64 = 10_000_000;

/// Returns contact-free noise, twice as large where a joint is slow.
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
                // A sum of uniform numbers is nearly Gaussian.
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

fn learnt(settings: &tauscope::Settings) -> tauscope::Settings {
    let train = [lesson(quiet(1, 6000)), lesson(quiet(2, 6000))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    tauscope::learn(settings, &setup(JOINTS), &lessons).unwrap()
}

fn detector(settings: tauscope::Settings) -> Detect {
    let config = Config::of(settings);
    config.stage(setup(JOINTS)).unwrap()
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
    // The push has left the longest window after 100 ms; a baseline peak may hold the alarm for another 100 ms.
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
        // Up to twice the noise, over two minutes.
        sample.effort[0] += 0.2 * k as f64 / 12_000.0;
    }
    assert!(onsets(&run(&mut detector, &samples)).is_empty());
}

#[test]
fn one_bad_reading_is_forgotten_as_soon_as_it_has_passed() {
    let mut detector = detector(learnt(&tauscope::Settings::default()));
    let mut samples = quiet(3, 3000);
    samples[1000].effort[1] = 5000.0;
    for sample in &mut samples[2000..2050] {
        sample.effort[1] -= 1.5;
    }
    let detections = run(&mut detector, &samples);
    let found = onsets(&detections);
    assert!(
        found
            .iter()
            .all(|k| (1000..1040).contains(k) || (2000..2050).contains(k))
    );
    assert!(found.iter().any(|k| *k >= 2000));
    assert!(detections[1060].score < 0.5 * detections[1060].threshold);
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
        kind: ContactKind::Contact,
        ignore: false,
    }]);
    let train = [lesson_];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap();
    let noise = &learnt.learnt().unwrap().windows[0].noise[0];
    assert!(noise.iter().all(|noise| *noise < 0.3), "{noise:?}");
}

#[test]
fn too_short_a_lesson_says_how_much_is_wanted() {
    let train = [lesson(quiet(1, 100))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let error =
        tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap_err();
    assert!(matches!(error, LearnError::TooLittle { .. }), "{error}");
}

#[test]
fn nothing_learnt_and_another_robot_are_refused() {
    let config = |settings| Config::of(settings);
    let bare = config(tauscope::Settings::default());
    let refused = |config: &Config, setup| config.stage(setup).err().unwrap();
    assert!(matches!(
        refused(&bare, setup(JOINTS)),
        ConfigError::NotLearnt { .. }
    ));
    let learnt = learnt(&tauscope::Settings::default());
    let (mut fewer, mut turned) = (setup(JOINTS), setup(JOINTS));
    fewer.joints.pop();
    fewer.joint_names.pop();
    turned.joint_names.reverse();
    for other in [fewer, turned] {
        let names = other.joint_names.join(", ");
        let text = refused(&config(learnt.clone()), other).to_string();
        assert!(
            text.contains(&format!("but the cell has {names}")),
            "{text}"
        );
    }
    let mut torn = learnt;
    let windows = &mut torn.learnt.as_mut().unwrap().here_mut().unwrap().windows;
    windows[1].noise[0].pop();
    let text = refused(&config(torn.clone()), setup(JOINTS)).to_string();
    assert!(text.contains("is not whole"), "{text}");
    torn.learnt
        .as_mut()
        .unwrap()
        .here_mut()
        .unwrap()
        .windows
        .clear();
    let text = refused(&config(torn), setup(JOINTS)).to_string();
    assert!(text.contains("is not whole"), "{text}");
}

#[test]
fn what_was_learnt_at_one_rate_does_not_judge_another_and_ends_where_there_is_no_other() {
    let mut stage = detector(learnt(&tauscope::Settings::default()));
    let mut slow = quiet(3, 600);
    for (i, sample) in slow.iter_mut().enumerate() {
        sample.header.stamp_ns = i as i64 * 20_000_000;
    }
    let mut out = Out::default();
    let error = (slow.iter()).find_map(|sample| stage.accept(sample, &mut out).err());
    let error = error.unwrap().to_string();
    // A wrong rate is tolerated for a few seconds.
    assert!((300..600).contains(&out.0.len()), "{}", out.0.len());
    assert!(out.0.iter().all(|it| !it.header.has(flags::READY)));
    assert!(error.contains("and here are 50.0"), "{error}");
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

#[test]
fn four_minutes_of_training_keep_a_wish_under_slow_drift() {
    let train = [lesson(quiet(11, 12_000)), lesson(quiet(12, 12_000))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    // The default is five false alarms per hour.
    let learnt = tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap();
    let mut alarms = 0;
    for seed in 20..30 {
        let mut samples = quiet(seed, 12_000);
        for (k, sample) in samples.iter_mut().enumerate() {
            sample.effort[0] += 0.2 * k as f64 / 12_000.0;
        }
        alarms += onsets(&run(&mut detector(learnt.clone()), &samples)).len();
    }
    // The expected number in twenty minutes is 1.7.
    assert!(alarms <= 5, "{alarms} alarms");
}

#[test]
fn a_contact_on_top_of_another_is_an_alarm_of_its_own_and_a_release_is_none() {
    let mut detector = detector(learnt(&tauscope::Settings::default()));
    let mut samples = quiet(3, 3000);
    for sample in &mut samples[1000..1200] {
        sample.effort[1] -= 1.5;
    }
    for sample in &mut samples[1100..1200] {
        sample.effort[2] -= 1.5;
    }
    let onsets = onsets(&run(&mut detector, &samples));
    assert_eq!(onsets.len(), 2, "{onsets:?}");
    assert!((1100..1110).contains(&onsets[1]), "{onsets:?}");
}

/// Three joints in a row, axes z, y, y, half a metre apart.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="shoulder"><inertial><origin xyz="0 0 0.25"/><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.1 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="shoulder"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>"#;

fn with_model() -> Setup {
    Setup {
        model: Some(Model::from_urdf(ARM).unwrap()),
        ..setup(JOINTS)
    }
}

#[test]
fn the_smallest_force_grows_with_the_wish_and_falls_along_the_arm() {
    let train = [lesson(quiet(1, 6000))];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &with_model(), &lessons).unwrap();
    let half = |per_hour: f64| -> Vec<Option<f64>> {
        let smallest = learnt.smallest_forces(per_hour);
        smallest.iter().map(|of_link| of_link.half_n).collect()
    };
    let (often, weekly) = (half(60.0), half(0.006));
    // The first link turns about its own axis: its joint senses only forces with a small lever.
    let all: Option<Vec<f64>> = often.iter().copied().collect();
    let all = all.unwrap();
    assert!(all[0] > all[1] && all[1] > all[2], "{often:?}");
    assert!(
        weekly[2] > often[2] && often[2] > Some(0.1),
        "{often:?} {weekly:?}"
    );
}

/// Returns a minute in which the lower link rotates and is touched every two seconds: against its motion, or along
/// with it.
fn touched(seed: u64) -> Lesson {
    let model = Model::from_urdf(ARM).unwrap();
    let mut data = Data::new(&model);
    let mut lesson = lesson(quiet(seed, 6000));
    let mut contacts = Vec::new();
    for k in 0..6000 {
        let sample = &mut lesson.samples[k];
        sample.position[..3].copy_from_slice(&[0.003 * k as f64, 0.8, 0.6]);
        sample.velocity[..3].copy_from_slice(&[0.3, 0.0, 0.0]);
        let (place, sense) = (k % 200, if (k / 200) % 2 == 0 { -1.0 } else { 1.0 });
        if !(100..140).contains(&place) {
            continue;
        }
        forward_kinematics(&model, &mut data, &sample.position[..3]);
        let force = 30.0 * sense;
        let mut torque = [0.0; 3];
        let point = Vector3::new(0.0, 0.0, 0.4);
        // Force along the point's motion, which only the first joint causes.
        let along = Vector3::new(-sample.position[0].sin(), sample.position[0].cos(), 0.0);
        point_jacobian(&model, &data, 3, &point, |j, linear, _| {
            torque[j] = linear.dot(&along) * force;
        });
        for (effort, torque) in sample.effort.iter_mut().zip(torque) {
            *effort -= torque;
        }
        if place == 100 {
            contacts.push(LabelledContact {
                on_ns: k as i64 * STEP_NS,
                off_ns: (k as i64 + 39) * STEP_NS,
                kind: if sense < 0.0 {
                    ContactKind::Collision
                } else {
                    ContactKind::Cooperation
                },
                ignore: false,
            });
        }
    }
    lesson.contacts = Some(contacts);
    lesson
}

/// Returns the detector trained on these recordings.
fn taught_by(train: &[Lesson]) -> Detect {
    let lessons = Lessons {
        train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &with_model(), &lessons).unwrap();
    let config = Config::of(learnt);
    config.stage(with_model()).unwrap()
}

#[test]
fn a_force_against_the_motion_is_a_collision_and_one_with_it_a_cooperation() {
    let train = [touched(1), lesson(quiet(2, 6000))];
    let mut detector = taught_by(&train);
    let test = touched(7);
    let detections = run(&mut detector, &test.samples);
    let onsets = onsets(&detections);
    let (mut right, mut all) = (0, 0);
    for contact in test.contacts.iter().flatten() {
        let of_contact = |k: &&usize| {
            let stamp = **k as i64 * STEP_NS;
            (contact.on_ns..=contact.off_ns).contains(&stamp)
        };
        let said = onsets
            .iter()
            .find(of_contact)
            .map(|k| detections[*k].state.to_string());
        let wanted = match contact.kind {
            ContactKind::Collision => "collision",
            _ => "cooperation",
        };
        all += 1;
        right += usize::from(said.as_deref() == Some(wanted));
    }
    assert!(all == 30 && right >= 27, "{right} of {all}");
}

#[test]
fn too_little_contact_free_time_is_said_and_the_threshold_stays_usable() {
    let learnt_from = |samples| {
        let train = [lesson(quiet(1, samples))];
        let lessons = Lessons {
            train: &train,
            validation: &[],
        };
        let settings = tauscope::Settings::default();
        Config::of(tauscope::learn(&settings, &setup(JOINTS), &lessons).unwrap())
    };
    let (little, much) = (learnt_from(600), learnt_from(6000));
    assert_eq!(much.warning(&setup(JOINTS)), None);
    let warning = little.warning(&setup(JOINTS)).unwrap();
    assert!(warning.contains("5.9 s"), "{warning}");
    let mut samples = quiet(3, 3000);
    for sample in &mut samples[1000..1050] {
        sample.effort[1] -= 1.5;
    }
    let onsets = onsets(&run(&mut little.stage(setup(JOINTS)).unwrap(), &samples));
    assert_eq!(onsets.len(), 1, "{onsets:?}");
    assert!((1000..1005).contains(&onsets[0]), "{onsets:?}");
}

#[test]
fn a_joint_that_never_stirred_while_it_learnt_is_not_believed_to_be_without_noise() {
    let mut still = quiet(1, 600);
    for sample in &mut still {
        sample.effort[2] = 0.0;
    }
    let train = [lesson(still)];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap();
    let noise = &learnt.learnt().unwrap().windows[0].noise;
    let (moved, still) = (noise[0][4], noise[2][4]);
    assert!(still > 0.01 * moved, "{still} {moved}");
}

/// Returns samples with pushes at `points` of links in turn, in all directions, and the link of each push.
fn pushed(points: &[(&'static str, usize, Vector3<f64>)]) -> (Vec<TwinState>, Vec<&'static str>) {
    let model = Model::from_urdf(ARM).unwrap();
    let mut data = Data::new(&model);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut samples = quiet(9, 6000);
    let mut links = Vec::new();
    let mut force = Vector3::zeros();
    for (k, sample) in samples.iter_mut().enumerate() {
        sample.position[..3].copy_from_slice(&[0.4, 0.8, 0.6]);
        let (link, body, point) = points[(k / 100) % points.len()];
        if k % 100 == 50 {
            let direction = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0));
            force = direction.normalize() * 25.0;
            links.push(link);
        }
        if k % 100 >= 50 {
            forward_kinematics(&model, &mut data, &sample.position[..3]);
            point_jacobian(&model, &data, body, &point, |j, linear, _| {
                sample.effort[j] -= linear.dot(&force);
            });
        }
    }
    (samples, links)
}

#[test]
fn the_link_that_was_pushed_is_told_wherever_on_it_that_was() {
    let train = [lesson(quiet(1, 6000)), lesson(quiet(2, 6000))];
    let mut detector = taught_by(&train);
    let (samples, links) = pushed(&[
        ("upper", 2, Vector3::new(0.03, 0.0, 0.3)),
        ("lower", 3, Vector3::new(0.0, 0.03, 0.2)),
        ("lower", 3, Vector3::new(0.1, 0.0, 0.3)),
    ]);
    let detections = run(&mut detector, &samples);
    let said = (0..links.len()).map(|k| detections[100 * k + 90].link.to_string());
    let right = said
        .zip(&links)
        .filter(|(said, link)| said == *link)
        .count();
    assert!(10 * right >= 8 * links.len(), "{right} of {}", links.len());
}
