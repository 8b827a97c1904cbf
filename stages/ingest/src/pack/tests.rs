// Copied values must be identical to the bit.
#![allow(clippy::float_cmp)]

use tauscope_session::Unusable;

use super::*;

const MS: i64 = 1_000_000;

fn setup() -> Setup {
    Setup {
        cell: "demo".to_owned(),
        joint_names: ["a", "b", "c"].map(str::to_owned).to_vec(),
        effort_limits: Vec::new(),
        tool: None,
        has_tool_link: false,
    }
}

fn settings() -> PackSettings {
    PackSettings {
        velocity_cutoff_hz: 20.0,
        max_age_ns: 500 * MS,
        wait_ns: 100 * MS,
        expects_command: false,
        expects_reference: false,
    }
}

fn packer() -> Packer {
    Packer::new(&setup(), settings()).unwrap()
}

/// A state of `names`, with positions, velocities ten times and efforts a hundred times as large.
fn message(stamp_ns: i64, names: &str, position: &[f64]) -> ros::JointState {
    ros::JointState {
        header: ros::Header::new(stamp_ns, ""),
        name: names.split_whitespace().map(str::to_owned).collect(),
        position: position.to_vec(),
        velocity: position.iter().map(|q| 10.0 * q).collect(),
        effort: position.iter().map(|q| 100.0 * q).collect(),
    }
}

/// Returns all packed samples, as if no command could follow.
fn drain(packer: &mut Packer) -> Vec<JointState> {
    std::iter::from_fn(|| packer.pop(i64::MAX)).collect()
}

#[test]
fn joints_are_packed_by_name() {
    let mut packer = packer();
    packer.state(&message(1000, "c x a b", &[3.0, 9.0, 1.0, 2.0]), 2000);
    packer.state(&message(1001, "a b c", &[1.0, 2.0, 3.0]), 2001);
    for (i, sample) in drain(&mut packer).iter().enumerate() {
        assert_eq!(sample.header.stamp_ns, 1000 + i as i64);
        assert_eq!(sample.header.received_ns, 2000 + i as i64);
        assert_eq!(sample.header.joint_count, 3);
        assert!(
            sample
                .header
                .has(flags::VELOCITY_MEASURED | flags::EFFORT_MEASURED)
        );
        assert_eq!(sample.position[..4], [1.0, 2.0, 3.0, 0.0]);
        assert_eq!(sample.velocity[..4], [10.0, 20.0, 30.0, 0.0]);
        assert_eq!(sample.effort[..4], [100.0, 200.0, 300.0, 0.0]);
    }
    assert_eq!(packer.counts().packed, 2);
    assert_eq!(packer.counts().dropped(), 0);
}

#[test]
fn two_publishers_with_a_part_of_the_arm_each_make_one_state() {
    let mut packer = packer();
    packer.state(&message(10 * MS, "c b", &[3.0, 2.0]), 10 * MS);
    packer.state(&message(11 * MS, "gripper", &[0.5]), 11 * MS);
    assert_eq!(packer.pop(i64::MAX), None);
    packer.state(&message(12 * MS, "a", &[1.0]), 12 * MS);
    let sample = packer.pop(i64::MAX).unwrap();
    assert_eq!(sample.position[..3], [1.0, 2.0, 3.0]);
    assert_eq!(sample.header.stamp_ns, 12 * MS);
    assert_eq!(packer.counts().foreign, 1);
    // The next round needs both again.
    packer.state(&message(22 * MS, "a", &[1.5]), 22 * MS);
    assert_eq!(packer.pop(i64::MAX), None);
    packer.state(&message(23 * MS, "b c", &[2.5, 3.5]), 23 * MS);
    assert_eq!(packer.pop(i64::MAX).unwrap().position[..3], [1.5, 2.5, 3.5]);
}

#[test]
fn messages_that_lack_a_joint_for_long_are_counted_and_slower_publishers_are_not() {
    let mut packer = packer();
    // One publisher at 100 Hz, the other at 50: no loss that could be detected.
    for n in 0..100 {
        let at = 10 * MS * n;
        packer.state(&message(at, "a b", &[1.0, 2.0]), at);
        if n % 2 == 0 {
            packer.state(&message(at + MS, "c", &[3.0]), at + MS);
        }
    }
    assert_eq!(drain(&mut packer).len(), 50);
    assert_eq!(packer.counts().dropped(), 0);
    // The second publisher is silent for a second, then resumes.
    for n in 100..200 {
        let at = 10 * MS * n;
        packer.state(&message(at, "a b", &[1.0, 2.0]), at);
    }
    assert_eq!(packer.counts().parted, 100);
    packer.state(&message(2000 * MS, "a b c", &[1.0, 2.0, 3.0]), 2000 * MS);
    assert_eq!(drain(&mut packer).len(), 1);
    // All but the last message, which has all joints, were dropped.
    assert_eq!(packer.counts().dropped(), 101);
}

#[test]
fn a_clock_that_stands_still_loses_what_it_stamps() {
    let mut packer = packer();
    for value in [1.0, 1.0, 1.5, 2.0] {
        packer.state(&message(MS, "a b c", &[value, 2.0, 3.0]), MS);
    }
    assert_eq!(drain(&mut packer).len(), 1);
    let counts = packer.counts();
    assert_eq!(
        (counts.repeated, counts.stalled, counts.dropped()),
        (1, 2, 2)
    );
}

#[test]
fn a_state_with_nan_is_dropped_and_counted() {
    let mut packer = packer();
    packer.state(&message(1, "a b c", &[1.0, 2.0, 3.0]), 1);
    packer.state(&message(2, "a b c", &[1.0, f64::NAN, 3.0]), 2);
    packer.state(&message(3, "a b c", &[1.0, f64::INFINITY, 3.0]), 3);
    // A NaN of another arm does not count.
    packer.state(&message(4, "a b c x", &[1.0, 2.0, 3.0, f64::NAN]), 4);
    assert_eq!(drain(&mut packer).len(), 2);
    assert_eq!(packer.counts().not_finite, 2);
    assert_eq!(packer.counts().dropped(), 2);
    assert_eq!(packer.verdict(), Ok(()));
}

#[test]
fn what_is_refused_is_told_by_joint_and_field_with_count_and_time() {
    let mut packer = packer();
    let mut told = Vec::new();
    for n in 0..200 {
        let stamp_ns = 1_000_000_000 * n;
        let mut state = message(stamp_ns.max(1), "a b c", &[1.0, 2.0, 3.0]);
        if (100..110).contains(&n) {
            state.effort[1] = f64::NAN;
        }
        if n == 105 {
            state.position[2] = f64::INFINITY;
        }
        packer.state(&state, stamp_ns);
        told.extend(packer.newly_refused(stamp_ns));
    }
    // A live source reports the first one at once, and later ones at most once a minute.
    assert_eq!(told.len(), 2, "{told:?}");
    let first = "the effort of b is NaN in 1 message at 100.000 s. These messages are not used. Check the driver and the sensor";
    assert_eq!(told[0], first);
    let all = "the effort of b is NaN in 10 messages from 100.000 s to 109.000 s. These messages are not used. \
               Check the driver and the sensor; the position of c is NaN or infinite in 1 message at 105.000 s. \
               These messages are not used. Check the driver and the sensor";
    assert_eq!(packer.refused().unwrap(), all);
    assert_eq!(told[1], all);
}

#[test]
fn a_message_that_names_a_joint_twice_is_refused_and_named() {
    let mut packer = packer();
    packer.state(&message(1, "a b c b", &[1.0, 2.0, 3.0, 4.0]), 1);
    packer.state(&message(2, "a b c b", &[1.0, 2.0, 3.0, 4.0]), 2);
    let named = "2 messages name joint `b` twice, as entries 2 and 4 of `name`";
    let verdict = packer.verdict().unwrap_err().to_string();
    assert!(verdict.starts_with(named), "{verdict}");
    assert_eq!(packer.counts().dropped(), 2);
    assert!(packer.refused().unwrap().starts_with(named));
    // Joints of another arm do not count.
    packer.state(&message(3, "a x b x c", &[1.0, 8.0, 2.0, 9.0, 3.0]), 3);
    let samples = drain(&mut packer);
    assert_eq!(samples.len(), 1);
    assert_eq!(samples[0].position[..3], [1.0, 2.0, 3.0]);
}

#[test]
fn a_joint_that_is_nan_throughout_is_named() {
    let mut packer = packer();
    for stamp in 1..100 {
        let mut state = message(stamp, "a b c", &[1.0, 2.0, 3.0]);
        state.effort[1] = f64::NAN;
        // An occasional NaN of another joint does not change the verdict.
        state.position[2] = if stamp % 2 == 0 { f64::NAN } else { 1.0 };
        packer.state(&state, stamp);
    }
    let error = packer.verdict().unwrap_err();
    assert_eq!(
        error.to_string(),
        "effort of joint `b` is NaN throughout (99 messages)"
    );
}

#[test]
fn joints_that_nobody_names_are_told() {
    let mut packer = packer();
    packer.state(&message(1, "a x", &[1.0, 2.0]), 1);
    packer.state(&message(2, "y", &[1.0]), 2);
    let verdict = packer.verdict().unwrap_err().to_string();
    assert!(
        verdict.starts_with("no joint state names b, c. 2 publishers send messages: (a, x with"),
        "{verdict}"
    );
    let nothing = Packer::new(&setup(), settings()).unwrap();
    assert_eq!(nothing.verdict(), Err(Unusable::NoSample { messages: 0 }));
}

#[test]
fn states_without_positions_are_told() {
    let mut packer = packer();
    let mut state = message(1, "a b c", &[1.0, 2.0, 3.0]);
    state.position.clear();
    packer.state(&state, 1);
    assert_eq!(packer.verdict(), Err(Unusable::NoPositions { messages: 1 }));
    assert_eq!(packer.counts().dropped(), 1);
}

#[test]
fn an_absent_velocity_is_differentiated_on_any_clock() {
    let mut packer = packer();
    let mut stamp_ns = 1_000 * MS;
    let slope = [0.3, -1.0, 2.0];
    let mut last = None;
    for i in 0..200 {
        stamp_ns += [8 * MS, 12 * MS][i % 2];
        let t_s = stamp_ns as f64 * 1e-9;
        let mut state = message(stamp_ns, "a b c", &slope.map(|v| v * t_s));
        state.velocity.clear();
        packer.state(&state, stamp_ns);
        // Half of the rows only repeat the row before, under a new stamp.
        stamp_ns += 5 * MS;
        state.header = ros::Header::new(stamp_ns, "");
        packer.state(&state, stamp_ns);
        last = drain(&mut packer).pop();
    }
    let last = last.unwrap();
    assert!(!last.header.has(flags::VELOCITY_MEASURED));
    for (velocity, slope) in last.velocity.iter().zip(slope) {
        assert!((velocity - slope).abs() < 1e-6, "{velocity} {slope}");
    }
}

#[test]
fn a_position_that_the_driver_wraps_goes_on_and_so_does_its_command() {
    let mut packer = Packer::new(
        &setup(),
        PackSettings {
            expects_command: true,
            ..settings()
        },
    )
    .unwrap();
    let mut all = Vec::new();
    let wrapped = |x: f64| x - std::f64::consts::TAU * (x / std::f64::consts::TAU).round();
    for i in 0..400_i64 {
        let (stamp_ns, q) = (i * 10 * MS, 2.0 + 0.01 * i as f64);
        let mut state = message(stamp_ns, "a b c", &[wrapped(q), 0.0, 0.0]);
        state.velocity.clear();
        packer.command(
            &message(stamp_ns, "a b c", &[wrapped(q + 0.1), 0.0, 0.0]),
            stamp_ns,
        );
        packer.state(&state, stamp_ns);
        all.extend(drain(&mut packer));
    }
    for (sample, q) in all.iter().zip((0..).map(|i| 2.0 + 0.01 * f64::from(i))) {
        assert!((sample.position[0] - q).abs() < 1e-9);
        assert!((sample.command_position[0] - q - 0.1).abs() < 1e-9);
    }
    let settled = all.iter().skip(50);
    assert!(
        settled
            .map(|s| s.velocity[0])
            .all(|v| (v - 1.0).abs() < 0.01)
    );
}

#[test]
fn a_gap_starts_the_velocity_anew_and_says_so() {
    let mut packer = packer();
    for stamp_ms in [1000, 1010, 1020, 2000, 2010] {
        let mut state = message(stamp_ms * MS, "a b c", &[stamp_ms as f64, 0.0, 0.0]);
        state.velocity.clear();
        packer.state(&state, stamp_ms * MS);
    }
    let samples = drain(&mut packer);
    let resets: Vec<_> = samples.iter().map(|s| s.header.has(flags::RESET)).collect();
    assert_eq!(resets, [false, false, false, true, false]);
    assert_eq!(samples[3].velocity[0], 0.0);
    // With a measured velocity, a gap does not set the flag.
    let mut packer = self::packer();
    for stamp_ms in [1000, 2000] {
        packer.state(&message(stamp_ms * MS, "a b c", &[0.0; 3]), stamp_ms * MS);
    }
    assert!(
        drain(&mut packer)
            .iter()
            .all(|s| !s.header.has(flags::RESET))
    );
}

#[test]
fn repeated_late_and_set_back_stamps() {
    let mut packer = packer();
    for stamp_ms in [1000, 1010, 1010, 1005, 1020, 400, 410] {
        packer.state(
            &message(stamp_ms * MS, "a b c", &[1.0, 2.0, 3.0]),
            stamp_ms * MS,
        );
    }
    let samples = drain(&mut packer);
    let stamps: Vec<_> = samples.iter().map(|s| s.header.stamp_ns / MS).collect();
    assert_eq!(stamps, [1000, 1010, 1020, 400, 410]);
    let resets: Vec<_> = samples.iter().map(|s| s.header.has(flags::RESET)).collect();
    assert_eq!(resets, [false, false, false, true, false]);
    let counts = packer.counts();
    assert_eq!((counts.repeated, counts.late, counts.resets), (1, 1, 1));
    assert_eq!(counts.dropped(), 1);
}

#[test]
fn a_stamp_of_zero_gives_way_to_the_time_of_reception() {
    let mut packer = packer();
    packer.state(&message(0, "a b c", &[1.0, 2.0, 3.0]), 77);
    assert_eq!(packer.pop(i64::MAX).unwrap().header.stamp_ns, 77);
}

#[test]
fn a_sample_waits_for_the_command_of_its_instant() {
    let settings = PackSettings {
        expects_command: true,
        ..settings()
    };
    let mut packer = Packer::new(&setup(), settings).unwrap();
    packer.command(&message(990 * MS, "a b c", &[0.9, 0.9, 0.9]), 990 * MS);
    packer.state(&message(1000 * MS, "a b c", &[1.0, 2.0, 3.0]), 1000 * MS);
    assert_eq!(packer.pop(1001 * MS), None);
    // The command of the same stamp is used although it arrives after the state.
    packer.command(&message(1000 * MS, "c b a", &[0.3, 0.2, 0.1]), 1002 * MS);
    let sample = packer.pop(1002 * MS).unwrap();
    assert!(sample.header.has(flags::COMMAND | flags::COMMAND_VELOCITY));
    assert_eq!(sample.command_position[..3], [0.1, 0.2, 0.3]);
    assert_eq!(sample.command_velocity[..3], [1.0, 2.0, 3.0]);
    // A command that arrives too late is not used, but the newest one before it.
    packer.state(&message(1010 * MS, "a b c", &[1.0, 2.0, 3.0]), 1010 * MS);
    assert_eq!(packer.pop(1109 * MS), None);
    let sample = packer.pop(1110 * MS).unwrap();
    assert_eq!(sample.command_position[..3], [0.1, 0.2, 0.3]);
    // A command that is too old is not attached.
    packer.state(&message(1501 * MS, "a b c", &[1.0, 2.0, 3.0]), 1501 * MS);
    let sample = packer.pop(i64::MAX).unwrap();
    assert!(!sample.header.has(flags::COMMAND));
    assert_eq!(sample.command_position[..3], [0.0; 3]);
}

#[test]
fn a_clock_of_reception_that_is_set_back_holds_no_sample() {
    let settings = PackSettings {
        expects_command: true,
        ..settings()
    };
    let mut packer = Packer::new(&setup(), settings).unwrap();
    let hour_ns = 3_600_000 * MS;
    packer.state(&message(1000 * MS, "a b c", &[1.0; 3]), hour_ns);
    assert_eq!(packer.pop(hour_ns - 1), None);
    assert!(packer.pop(5 * MS).is_some());
    // The next one waits as long as any other.
    packer.state(&message(1010 * MS, "a b c", &[1.0; 3]), 10 * MS);
    assert_eq!(packer.pop(109 * MS), None);
    assert!(packer.pop(110 * MS).is_some());
}

#[test]
fn a_command_of_the_future_is_not_taken() {
    let mut packer = packer();
    packer.command(&message(1020 * MS, "a b c", &[2.0; 3]), 1000 * MS);
    packer.state(&message(1010 * MS, "a b c", &[1.0; 3]), 1010 * MS);
    packer.state(&message(1030 * MS, "a b c", &[1.0; 3]), 1030 * MS);
    let samples = drain(&mut packer);
    assert!(!samples[0].header.has(flags::COMMAND));
    assert!(samples[1].header.has(flags::COMMAND));
}

#[test]
fn another_twins_effort_comes_along() {
    let mut packer = packer();
    let mut reference = message(1000 * MS, "b a c", &[2.0, 1.0, 3.0]);
    reference.position.clear();
    reference.velocity.clear();
    packer.reference(&reference, 1000 * MS);
    packer.state(&message(1001 * MS, "a b c", &[0.0; 3]), 1001 * MS);
    let sample = packer.pop(i64::MAX).unwrap();
    assert!(sample.header.has(flags::REFERENCE));
    assert_eq!(sample.reference_effort[..3], [100.0, 200.0, 300.0]);
}

#[test]
fn a_tool_is_taken_up_and_put_down() {
    let fixed = Tool {
        mass_kg: 0.2,
        ..Tool::default()
    };
    let setup = Setup {
        tool: Some(fixed),
        ..setup()
    };
    let mut packer = Packer::new(&setup, settings()).unwrap();
    let mut tool = ros::InertiaStamped::default();
    for (stamp_ms, mass_kg) in [(1010, 1.5), (1030, 0.0)] {
        tool.header = ros::Header::new(stamp_ms * MS, "tool");
        tool.inertia.m = mass_kg;
        tool.inertia.com.z = 0.05;
        packer.tool(&tool, stamp_ms * MS);
    }
    for stamp_ms in [1000, 1010, 1020, 1030, 90_000] {
        packer.state(&message(stamp_ms * MS, "a b c", &[0.0; 3]), stamp_ms * MS);
    }
    let masses: Vec<_> = drain(&mut packer)
        .iter()
        .map(|s| (s.header.has(flags::TOOL), s.tool_mass_kg))
        .collect();
    let nothing = (false, 0.0);
    assert_eq!(
        masses,
        [(true, 0.2), (true, 1.5), (true, 1.5), nothing, nothing]
    );
}

#[test]
fn waiting_samples_are_bounded() {
    let settings = PackSettings {
        expects_command: true,
        wait_ns: i64::MAX,
        ..settings()
    };
    let mut packer = Packer::new(&setup(), settings).unwrap();
    for i in 1..=(MAX_PENDING as i64 + 5) {
        packer.state(&message(i, "a b c", &[0.0; 3]), i);
        if let Some(sample) = packer.pop(i) {
            assert_eq!(sample.header.stamp_ns, i - MAX_PENDING as i64 + 1);
        }
    }
    assert_eq!(packer.counts().packed, 6);
    packer.flush();
    assert_eq!(drain(&mut packer).len(), MAX_PENDING - 1);
}

#[test]
fn a_request_for_learning_belongs_to_the_next_state_alone() {
    let mut packer = packer();
    packer.state(&message(1000, "a b c", &[1.0, 2.0, 3.0]), 2000);
    packer.learn(ros::Bool { data: true });
    packer.learn(ros::Bool { data: false });
    // A repeated state is no sample, so it does not use up the request.
    packer.state(&message(1000, "a b c", &[1.0, 2.0, 3.0]), 2001);
    packer.state(&message(1002, "a b c", &[1.0, 2.0, 3.0]), 2002);
    packer.state(&message(1003, "a b c", &[1.0, 2.0, 3.0]), 2003);
    let asked = drain(&mut packer);
    let asked: Vec<bool> = asked.iter().map(|s| s.header.has(flags::LEARN)).collect();
    assert_eq!(asked, [false, true, false]);
}
