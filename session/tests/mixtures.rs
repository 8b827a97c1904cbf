//! Random mixtures of publishers, clocks and values whose truth is known: what is handed on is the arm's own motion, every
//! message is accounted for, and what was done to the recording is a finding.

use proptest::prelude::*;
use tauscope_archive::ros::{Header, JointState};
use tauscope_archive::{Compression, McapWriter, Recording};
use tauscope_session::{Counts, Finding, Joints, Look, Survey, Taken};

const EPOCH_NS: i64 = 1_760_000_000_000_000_000;
const STEP_NS: i64 = 10_000_000;
const ROWS: i64 = 600;
const ARM: [&str; 3] = ["pan", "lift", "elbow"];

/// Fault of the stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stamps {
    Sound,
    FromZero,
    Zero,
    Coarse,
    Milliseconds,
    /// Begin again at this row.
    Loop(i64),
}

/// A second publisher on the topic.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Second {
    None,
    GripperFirst,
    PositionsOnly,
    ZeroEfforts,
}

/// Fault of single values of one joint's effort.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Values {
    Sound,
    Garbage(f64),
    Dropout,
    NotANumber,
}

fn mixtures() -> impl Strategy<Value = (Stamps, Second, Values, usize)> {
    let stamps = prop_oneof![
        Just(Stamps::Sound),
        Just(Stamps::FromZero),
        Just(Stamps::Zero),
        Just(Stamps::Coarse),
        Just(Stamps::Milliseconds),
        (200..500_i64).prop_map(Stamps::Loop),
    ];
    let second = prop_oneof![
        Just(Second::None),
        Just(Second::GripperFirst),
        Just(Second::PositionsOnly),
        Just(Second::ZeroEfforts),
    ];
    let garbage = prop_oneof![
        Just(1.8e237),
        Just(-1.0e224),
        Just(1e-308),
        Just(2.9e-321),
        Just(6.5e8)
    ];
    let values = prop_oneof![
        Just(Values::Sound),
        garbage.prop_map(Values::Garbage),
        Just(Values::Dropout),
        Just(Values::NotANumber),
    ];
    (stamps, second, values, 0..ARM.len())
}

/// True position of a joint in a row \[rad\].
fn position(joint: usize, row: i64) -> f64 {
    0.5 * (0.013 * row as f64 + joint as f64).sin()
}

/// True effort of a joint in a row \[N m\].
fn effort(joint: usize, row: i64) -> f64 {
    let own = 3.0 + joint as f64;
    4.0 * own + own * (0.02 * row as f64 + joint as f64).cos()
}

/// Rows whose effort is faulty.
fn is_faulty(row: i64) -> bool {
    (300..306).contains(&(row % 400))
}

fn stamp_ns(stamps: Stamps, row: i64) -> i64 {
    let since_ns = row * STEP_NS;
    match stamps {
        Stamps::Sound => EPOCH_NS + since_ns,
        Stamps::FromZero => since_ns,
        Stamps::Zero => 0,
        Stamps::Coarse => EPOCH_NS + since_ns / (5 * STEP_NS) * (5 * STEP_NS),
        Stamps::Milliseconds => 1000 * since_ns,
        Stamps::Loop(again) => EPOCH_NS + row % again * STEP_NS,
    }
}

/// Writes the mixture; returns the recording and the number of messages.
fn recording(
    folder: &std::path::Path,
    (stamps, second, values, joint): (Stamps, Second, Values, usize),
) -> (Recording, u64) {
    let path = folder.join("mixture.mcap");
    let provenance = std::collections::BTreeMap::new();
    let mut writer = McapWriter::create(&path, Compression::None, &provenance).expect("room");
    let topic = writer
        .add_topic::<JointState>("/joint_states")
        .expect("a topic");
    let mut count = 0;
    let mut write = |row: i64, state: &JointState, late_ns: i64| {
        let log_ns = EPOCH_NS + row * STEP_NS + late_ns;
        writer.write(topic, log_ns, log_ns, state).expect("room");
        count += 1;
    };
    let names = |names: &[&str]| {
        names
            .iter()
            .map(|&name| name.to_owned())
            .collect::<Vec<_>>()
    };
    for row in 0..ROWS {
        let header = Header::new(stamp_ns(stamps, row), "");
        let gripper = JointState {
            header: header.clone(),
            name: names(&["finger"]),
            position: vec![0.02],
            velocity: Vec::new(),
            effort: vec![0.0],
        };
        if second == Second::GripperFirst && row % 5 == 0 {
            write(row, &gripper, 0);
        }
        let mut state = JointState {
            header,
            name: names(&ARM),
            position: (0..ARM.len()).map(|joint| position(joint, row)).collect(),
            velocity: Vec::new(),
            effort: (0..ARM.len()).map(|joint| effort(joint, row)).collect(),
        };
        if is_faulty(row) {
            match values {
                Values::Sound => {}
                Values::Garbage(value) => state.effort[joint] = value,
                Values::Dropout => state.effort[joint] = 0.0,
                Values::NotANumber => state.effort[joint] = f64::NAN,
            }
        }
        write(row, &state, 1_000_000);
        if row % 4 == 0 {
            match second {
                Second::PositionsOnly => state.effort.clear(),
                Second::ZeroEfforts => state.effort.fill(0.0),
                _ => continue,
            }
            write(row, &state, 4_000_000);
        }
    }
    writer.finish().expect("room");
    (Recording::open(&path).expect("a recording"), count)
}

/// Messages that the counts account for.
fn accounted(counts: &Counts, handed_on: u64) -> u64 {
    handed_on + counts.dropped() + counts.repeated + counts.copies + counts.foreign + counts.unused
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 48,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(44),
        ..ProptestConfig::default()
    })]

    #[test]
    fn the_arm_is_read_whatever_is_mixed_in((stamps, second, values, joint) in mixtures()) {
        let folder = tempfile::tempdir().expect("a folder");
        let (recording, messages) = recording(folder.path(), (stamps, second, values, joint));
        let names = ARM.map(str::to_owned);
        let wanted = Joints { names: &names, effort_limits: &[] };
        let look = Look::at(&recording, None, wanted).expect("joint states");
        let mut assembler = look.assembler().refusing_set_back();
        let mut states = recording.joint_states(&look.topic).expect("the topic");
        let (mut handed_on, mut before_ns, mut row) = (0, None, -1);
        while let Some(state) = states.next_state() {
            let state = state.expect("a sound file");
            let arm = state.message.name.len() == ARM.len() && !state.message.effort.is_empty();
            let taken = assembler.take(state.message, state.log_time_ns);
            if arm && state.log_time_ns % STEP_NS == 1_000_000 {
                row = (state.log_time_ns - EPOCH_NS) / STEP_NS;
            }
            let Taken::Follows(whole) = taken else {
                prop_assert!(taken == Taken::Nothing, "nothing begins anew");
                continue;
            };
            handed_on += 1;
            prop_assert!(before_ns.is_none_or(|before_ns| whole.stamp_ns > before_ns));
            before_ns = Some(whole.stamp_ns);
            for own in 0..ARM.len() {
                prop_assert!((whole.position[own] - position(own, row)).abs() < 1e-12);
                if whole.has_effort {
                    prop_assert!((whole.effort[own] - effort(own, row)).abs() < 1e-9, "row {row}");
                }
            }
        }
        let counts = assembler.counts();
        prop_assert_eq!(accounted(&counts, handed_on), messages);
        let of_loop = if let Stamps::Loop(again) = stamps { ROWS - again } else { 0 };
        let faulty = if matches!(values, Values::Garbage(_) | Values::NotANumber) { 12 } else { 0 };
        prop_assert!(handed_on as i64 >= ROWS - of_loop - faulty, "{counts:?}");

        let survey = Survey::of(&recording, "/joint_states").expect("joint states");
        let has = |is_one: fn(&Finding) -> bool| survey.findings.iter().any(is_one);
        prop_assert_eq!(survey.publishers.len() > 1, second != Second::None);
        prop_assert_eq!(has(|it| matches!(it, Finding::ConstantStamps { .. })), stamps == Stamps::Zero);
        prop_assert_eq!(has(|it| matches!(it, Finding::CoarseStamps { .. })), stamps == Stamps::Coarse);
        prop_assert_eq!(has(|it| matches!(it, Finding::ScaledStamps { .. })), stamps == Stamps::Milliseconds);
        prop_assert_eq!(has(|it| matches!(it, Finding::JumpsBack { .. })), of_loop > 0);
        prop_assert_eq!(has(|it| matches!(it, Finding::Dropouts { .. })), values == Values::Dropout);
        prop_assert_eq!(has(|it| matches!(it, Finding::NotFinite { .. })), values == Values::NotANumber);
        let is_garbage = matches!(values, Values::Garbage(_));
        prop_assert_eq!(has(|it| matches!(it, Finding::Impossible { .. })), is_garbage);
        // A value of 300 digits would make the sentence longer.
        for finding in &survey.findings {
            prop_assert!(finding.to_string().len() < 700, "{finding}");
        }
    }
}
