//! Live sources over loopback, with publishers that imitate ROS 2.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::common::{Collect, cell, state, step};
use tauscope_archive::ros::{self, Message};
use tauscope_bus::{JointState, Source, flags};
use tauscope_ingest::{Config, Keys, Topics, ZenohConfig, ZenohSource};
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(30);
const MS: i64 = 1_000_000;

/// Returns an endpoint without a listener.
fn endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    format!("tcp/127.0.0.1:{port}")
}

fn publisher(listen: &str) -> Session {
    open(&[
        ("mode", "\"router\""),
        ("listen/endpoints", &format!("[\"{listen}\"]")),
    ])
}

/// Opens a session like that of an `rmw_zenoh` node behind its router.
fn node(router: &str) -> Session {
    open(&[
        ("mode", "\"peer\""),
        ("connect/endpoints", &format!("[\"{router}\"]")),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]"),
    ])
}

fn open(settings: &[(&str, &str)]) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in settings
        .iter()
        .chain(&[("scouting/multicast/enabled", "false")])
    {
        config.insert_json5(key, value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

fn source(endpoint: &str, keys: Keys, topics: Topics) -> ZenohSource {
    let zenoh = ZenohConfig {
        connect: vec![endpoint.to_owned()],
        keys,
        topics,
        ..ZenohConfig::default()
    };
    ZenohSource::open(&zenoh, &Config::default(), &cell("a b")).unwrap()
}

fn attachment(sequence: i64) -> Vec<u8> {
    let mut bytes = sequence.to_le_bytes().to_vec();
    bytes.extend(7_i64.to_le_bytes());
    bytes.push(16);
    bytes.extend([9; 16]);
    bytes
}

fn body(message: &ros::JointState) -> Vec<u8> {
    let mut body = Vec::new();
    ros::encode(message, &mut body).unwrap();
    body
}

/// Encodes a state like `ros2_control`, with a sensor among the joints. An effort that is NaN is left out.
fn dynamic_body(state: &ros::JointState) -> Vec<u8> {
    let interfaces = |named: &[(&str, f64)]| ros::InterfaceValue {
        interface_names: named.iter().map(|(name, _)| (*name).to_owned()).collect(),
        values: named.iter().map(|(_, value)| *value).collect(),
    };
    let joint = |i: usize| {
        let mut all = vec![("temperature", 40.0), ("position", state.position[i])];
        let effort = state.effort[i];
        all.extend((!effort.is_nan()).then_some(("effort", effort)));
        interfaces(&all)
    };
    let mut message = ros::DynamicJointState {
        header: state.header.clone(),
        joint_names: state.name.clone(),
        interface_values: (0..state.name.len()).map(joint).collect(),
    };
    message.joint_names.insert(0, "wrist_ft".to_owned());
    let sensor = interfaces(&[("force.x", 1.0)]);
    message.interface_values.insert(0, sensor);
    let mut body = Vec::new();
    ros::encode(&message, &mut body).unwrap();
    body
}

/// Publishes states until the first one arrives, since a subscription takes time to be matched.
fn meet(session: &Session, key: &str, source: &mut ZenohSource) {
    let deadline = Instant::now() + PATIENCE;
    let mut out = Collect(Vec::new());
    while out.0.is_empty() {
        assert!(Instant::now() < deadline, "nothing came through");
        session
            .put(key, body(&state(MS, "a b", &[0.0, 0.0], &[])))
            .wait()
            .unwrap();
        step(source, &mut out);
    }
}

/// Steps until `count` samples have arrived.
fn receive(source: &mut ZenohSource, count: usize) -> Vec<JointState> {
    let deadline = Instant::now() + PATIENCE;
    let mut out = Collect(Vec::new());
    while out.0.len() < count {
        assert!(Instant::now() < deadline, "{} of {count} came", out.0.len());
        step(source, &mut out);
    }
    out.0
}

#[test]
fn a_measurement_that_is_repeated_for_two_seconds_is_none_until_it_changes() {
    let endpoint = endpoint();
    let session = publisher(&endpoint);
    let mut source = source(&endpoint, Keys::Tauscope, Topics::default());
    let key = "demo/joint_states";
    meet(&session, key, &mut source);
    let mut put = |ms: i64, effort: f64| {
        let mut message = state(ms * MS, "a b", &[0.1, 0.2], &[effort, 1.0]);
        message.velocity = vec![0.0, 0.3];
        session.put(key, body(&message)).wait().unwrap();
        let sample = receive(&mut source, 1).remove(0);
        (sample.header.has(flags::EFFORT_MEASURED), sample.effort[0])
    };
    for ms in [1000, 2000, 2900] {
        assert_eq!(put(ms, 3.0), (true, 3.0), "{ms} ms");
    }
    assert_eq!(put(3000, 3.0), (false, 0.0));
    assert_eq!(put(3100, 3.5), (true, 3.5));
}

#[test]
fn rmw_zenoh_with_commands_and_lost_messages() {
    let endpoint = endpoint();
    let session = publisher(&endpoint);
    let topics = Topics {
        command: Some("/joint_commands".to_owned()),
        ..Topics::default()
    };
    let mut source = source(&endpoint, Keys::RmwZenoh, topics);
    let key = |topic: &str| {
        format!(
            "0/{topic}/{}/{}",
            ros::JointState::dds_type(),
            ros::JointState::TYPE_HASH
        )
    };
    let (states, commands) = (key("joint_states"), key("joint_commands"));
    meet(&session, &states, &mut source);
    for i in 1..=50_i64 {
        let (stamp_ns, q) = (1000 * MS + i * 10 * MS, i as f64);
        session
            .put(&commands, body(&state(stamp_ns, "b a", &[-q, q], &[])))
            .wait()
            .unwrap();
        // Number 20 is lost in transport.
        let put = session
            .put(
                &states,
                body(&state(stamp_ns, "b a", &[2.0 * q, q], &[0.2, 0.1])),
            )
            .attachment(attachment(if i < 20 { i } else { i + 1 }));
        put.wait().unwrap();
    }
    let samples = receive(&mut source, 50);
    let (first, last) = (&samples[0], &samples[samples.len() - 1]);
    assert_eq!(last.position[..2], [50.0, 100.0]);
    assert_eq!(last.effort[..2], [0.1, 0.2]);
    assert!(last.header.has(flags::COMMAND));
    assert_eq!(last.command_position[..2], [50.0, -50.0]);
    assert_eq!(last.header.stamp_ns, 1500 * MS);
    assert!(last.header.received_ns >= first.header.received_ns);
    assert!(
        first.header.received_ns > 1_600_000_000_000 * MS,
        "a clock of this century"
    );
    assert_eq!(source.counts().lost, 1);
    assert_eq!(source.counts().undecodable, 0);
    assert_eq!(source.dropped(), 1);
}

#[test]
fn a_node_behind_a_router_is_heard() {
    let endpoint = endpoint();
    let _router = publisher(&endpoint);
    let session = node(&endpoint);
    let mut source = source(&endpoint, Keys::RmwZenoh, Topics::default());
    let (dds_type, hash) = (ros::JointState::dds_type(), ros::JointState::TYPE_HASH);
    let key = format!("0/joint_states/{dds_type}/{hash}");
    meet(&session, &key, &mut source);
}

#[test]
fn another_version_of_the_type_is_heard() {
    let endpoint = endpoint();
    let session = publisher(&endpoint);
    let mut source = source(&endpoint, Keys::RmwZenoh, Topics::default());
    let key = format!("0/joint_states/{}/RIHS01_0123", ros::JointState::dds_type());
    meet(&session, &key, &mut source);
    assert_eq!(source.dropped(), 0);
}

#[test]
fn a_bridge_and_our_own_keys() {
    for (keys, namespace, key) in [
        (Keys::Ros2dds, Some("bot1"), "bot1/joint_states"),
        (Keys::Tauscope, None, "demo/joint_states"),
    ] {
        let endpoint = endpoint();
        let session = publisher(&endpoint);
        let zenoh = ZenohConfig {
            connect: vec![endpoint],
            keys,
            namespace: namespace.map(str::to_owned),
            ..ZenohConfig::default()
        };
        let mut source = ZenohSource::open(&zenoh, &Config::default(), &cell("a b")).unwrap();
        meet(&session, key, &mut source);
        // A message that is not a joint state is counted and skipped.
        session.put(key, vec![1, 2, 3]).wait().unwrap();
        session
            .put(key, body(&state(5000 * MS, "a b", &[1.0, 2.0], &[])))
            .wait()
            .unwrap();
        let samples = receive(&mut source, 1);
        assert_eq!(samples[0].position[..2], [1.0, 2.0]);
        assert_eq!(source.counts().undecodable, 1);
        assert_eq!(source.dropped(), 1);
    }
}

#[test]
fn a_publisher_that_comes_late_and_one_that_comes_back_are_heard() {
    let endpoint = endpoint();
    let mut source = source(&endpoint, Keys::Tauscope, Topics::default());
    let mut nothing = Collect(Vec::new());
    source.step(&mut nothing).unwrap();
    assert!(nothing.0.is_empty() && !source.is_connected());
    let key = "demo/joint_states";
    for round in 1..=2 {
        let session = publisher(&endpoint);
        meet_at(&session, key, &mut source, round * 100_000);
        session.close().wait().unwrap();
    }
}

/// Like [`meet`], with stamps from `first_ms` on.
fn meet_at(session: &Session, key: &str, source: &mut ZenohSource, first_ms: i64) {
    let deadline = Instant::now() + PATIENCE;
    let mut out = Collect(Vec::new());
    let mut stamp_ms = first_ms;
    while !out
        .0
        .iter()
        .any(|s: &JointState| s.header.stamp_ns >= first_ms * MS)
    {
        assert!(Instant::now() < deadline, "nothing came through");
        stamp_ms += 1;
        session
            .put(key, body(&state(stamp_ms * MS, "a b", &[0.0, 0.0], &[])))
            .wait()
            .unwrap();
        step(source, &mut out);
    }
}

#[test]
fn a_busy_pipeline_loses_the_oldest_and_says_how_many() {
    let endpoint = endpoint();
    let session = publisher(&endpoint);
    let zenoh = ZenohConfig {
        connect: vec![endpoint],
        keys: Keys::Tauscope,
        queue: 10,
        ..ZenohConfig::default()
    };
    let mut source = ZenohSource::open(&zenoh, &Config::default(), &cell("a b")).unwrap();
    let key = "demo/joint_states";
    meet(&session, key, &mut source);
    // Messages of the first contact may still be on their way.
    for _ in 0..20 {
        step(&mut source, &mut Collect(Vec::new()));
    }
    for i in 1..=100_i64 {
        let put = session.put(key, body(&state(i * 10 * MS, "a b", &[i as f64, 0.0], &[])));
        put.congestion_control(zenoh::qos::CongestionControl::Block)
            .wait()
            .unwrap();
    }
    let deadline = Instant::now() + PATIENCE;
    while source.counts().overflowed < 90 {
        assert!(Instant::now() < deadline, "{:?}", source.counts());
        std::thread::sleep(Duration::from_millis(5));
    }
    let samples = receive(&mut source, 10);
    let kept: Vec<_> = samples.iter().map(|s| s.position[0]).collect();
    assert_eq!(kept, (91..=100).map(f64::from).collect::<Vec<_>>());
    assert_eq!(source.dropped(), 90);
}

#[test]
fn what_cannot_work_is_refused() {
    let open = |zenoh: ZenohConfig| {
        ZenohSource::open(&zenoh, &Config::default(), &cell("a b")).unwrap_err()
    };
    let error = open(ZenohConfig::default());
    assert!(error.is_input());
    assert!(
        error.to_string().contains("`connect` or `listen`"),
        "{error}"
    );
    let nonsense = ZenohConfig {
        connect: vec!["localhost:7447".to_owned()],
        ..ZenohConfig::default()
    };
    let error = open(nonsense);
    assert!(error.is_input());
    assert!(error.to_string().contains("localhost:7447"), "{error}");
}

#[test]
fn dynamic_joint_states_of_ros2_control_are_joint_states() {
    let rmw = format!(
        "0/dynamic_joint_states/{}/{}",
        ros::DynamicJointState::dds_type(),
        ros::DynamicJointState::TYPE_HASH
    );
    for (keys, key) in [
        (Keys::RmwZenoh, rmw.as_str()),
        (Keys::Tauscope, "demo/dynamic_joint_states"),
    ] {
        let endpoint = endpoint();
        let session = publisher(&endpoint);
        let topics = Topics {
            state: "/dynamic_joint_states".to_owned(),
            ..Topics::default()
        };
        let mut source = source(&endpoint, keys, topics);
        let deadline = Instant::now() + PATIENCE;
        let mut out = Collect(Vec::new());
        for i in 1.. {
            assert!(Instant::now() < deadline, "nothing came through");
            let state = state(i * MS, "b a", &[2.0, 1.0], &[20.0, 10.0]);
            session.put(key, dynamic_body(&state)).wait().unwrap();
            step(&mut source, &mut out);
            if let Some(sample) = out.0.first() {
                assert_eq!(sample.position[..2], [1.0, 2.0]);
                assert_eq!(sample.effort[..2], [10.0, 20.0]);
                assert!(sample.header.has(flags::EFFORT_MEASURED));
                break;
            }
        }
        assert_eq!(source.counts().undecodable, 0);
    }
}

#[test]
fn a_joint_whose_effort_nobody_publishes_is_named() {
    let endpoint = endpoint();
    let session = publisher(&endpoint);
    let mut source = source(&endpoint, Keys::Tauscope, Topics::default());
    let (deadline, began) = (Instant::now() + PATIENCE, Instant::now());
    let mut out = Collect(Vec::new());
    let mut i = 0;
    let trouble = loop {
        assert!(Instant::now() < deadline, "nothing was said");
        i += 1;
        let state = state(i * MS, "b a", &[2.0, 1.0], &[f64::NAN, 10.0]);
        session
            .put("demo/joint_states", dynamic_body(&state))
            .wait()
            .unwrap();
        step(&mut source, &mut out);
        match source.trouble(began.elapsed()) {
            Some(trouble) if source.pack_counts().not_finite > 0 => break trouble,
            _ => {}
        }
    };
    assert!(out.0.is_empty());
    let said = format!("{trouble:?}");
    assert!(said.contains("no effort of joint `b`"), "{said}");
}
