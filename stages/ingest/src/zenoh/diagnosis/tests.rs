use tauscope_archive::ros::{self, Message as _};

use super::*;
use crate::config::ZenohConfig;

fn names(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

fn expected(keys: Keys, namespace: Option<&str>) -> Expected {
    let config = ZenohConfig {
        keys,
        namespace: namespace.map(str::to_owned),
        ..ZenohConfig::default()
    };
    Expected {
        scheme: KeyScheme::new(&config, "demo"),
        topic: "/joint_states".to_owned(),
        joints: names("joint1 joint2"),
        connect: names("tcp/10.0.0.1:7447"),
        listen: Vec::new(),
    }
}

/// A session on which these keys were heard once, with a joint state of `joints` (or text without any).
fn seen(keys: &[(&str, &str)]) -> Seen {
    let mut seen = Seen {
        connected: 1,
        ..Seen::default()
    };
    for (key, joints) in keys {
        let mut body = b"text".to_vec();
        if !joints.is_empty() {
            let state = ros::JointState {
                name: names(joints),
                ..ros::JointState::default()
            };
            body.clear();
            ros::encode(&state, &mut body).unwrap();
        }
        seen.publications.hear(key, &body, None);
    }
    seen
}

fn rmw(topic: &str, domain: u32) -> String {
    let hash = ros::JointState::TYPE_HASH;
    format!("{domain}/{topic}/{}/{hash}", ros::JointState::dds_type())
}

#[test]
fn each_slip_in_the_key_has_its_answer() {
    let joints = "joint1 joint2";
    for (keys, namespace, key, answer) in [
        (
            Keys::RmwZenoh,
            None,
            rmw("joint_state", 0),
            "the topic is /joint_state, you wrote /joint_states",
        ),
        (
            Keys::RmwZenoh,
            None,
            rmw("left/arm", 0),
            "joint states are published on /left/arm",
        ),
        (
            Keys::RmwZenoh,
            None,
            rmw("joint_states", 5),
            "set `domain: 5`",
        ),
        (
            Keys::RmwZenoh,
            None,
            "bot1/joint_states".to_owned(),
            "`keys: ros2dds`, `namespace: bot1`",
        ),
        (
            Keys::Ros2dds,
            Some("bot1"),
            rmw("joint_states", 0),
            "`keys: rmw_zenoh`, `domain: 0`",
        ),
        (
            Keys::Ros2dds,
            Some("bot1"),
            "bot2/joint_states".to_owned(),
            "set `namespace: bot2`",
        ),
        (
            Keys::Ros2dds,
            Some("bot1"),
            "joint_states".to_owned(),
            "set `namespace: \"\"`",
        ),
        (
            Keys::Tauscope,
            None,
            "demo/joint_state".to_owned(),
            "the topic is /joint_state, you wrote",
        ),
    ] {
        let trouble = diagnose(
            &expected(keys, namespace),
            &Fed::default(),
            &seen(&[(&key, joints)]),
        );
        assert!(trouble.what.starts_with("no publisher of "), "{trouble}");
        let likely = trouble.likely.clone().unwrap();
        assert!(likely.contains(answer), "{keys:?} {key}: {trouble}");
        assert!(
            trouble.seen[0].contains("joints joint1, joint2"),
            "{trouble}"
        );
    }
}

#[test]
fn the_same_topic_with_another_type_is_named() {
    let text = "0/joint_states/std_msgs::msg::dds_::String_/RIHS01_x";
    let trouble = diagnose(
        &expected(Keys::RmwZenoh, None),
        &Fed::default(),
        &seen(&[(text, "")]),
    );
    let likely = trouble.likely.unwrap();
    assert!(
        likely.contains("/joint_states carries std_msgs/msg/String"),
        "{likely}"
    );
}

#[test]
fn nobody_at_all_and_no_router_are_told_apart() {
    let expected = expected(Keys::RmwZenoh, None);
    let alone = diagnose(&expected, &Fed::default(), &seen(&[]));
    assert!(alone.likely.unwrap().contains("nothing is published"));
    let fault = Some("connection refused".to_owned());
    let away = Seen {
        endpoints: vec![(expected.connect[0].clone(), fault)],
        ..Seen::default()
    };
    let away = diagnose(&expected, &Fed::default(), &away);
    assert_eq!(away.what, "router tcp/10.0.0.1:7447 cannot be reached");
    assert_eq!(away.seen, ["tcp/10.0.0.1:7447: connection refused"]);
}

#[test]
fn messages_that_cannot_be_used_are_told_of() {
    let expected = expected(Keys::Tauscope, None);
    let fed = |change: &dyn Fn(&mut Fed)| {
        let mut fed = Fed {
            messages: 7500,
            ..Fed::default()
        };
        change(&mut fed);
        fed
    };
    for (fed, joints, what) in [
        (
            fed(&|fed| fed.foreign = 7500),
            "shoulder elbow",
            "name none of this robot's joints",
        ),
        (
            fed(&|_| ()),
            "joint1",
            "do not name all of this robot's joints",
        ),
        (
            fed(&|fed| fed.undecodable = 7500),
            "",
            "are no sensor_msgs/msg/JointState",
        ),
        (
            fed(&|fed| fed.incomplete = 7500),
            "joint1 joint2",
            "have no positions",
        ),
        (
            fed(&|fed| {
                fed.twice = Some(tauscope_archive::Twice {
                    joint: "joint1".to_owned(),
                    entries: [1, 3],
                    messages: 7500,
                });
            }),
            "joint1 joint2",
            "name joint `joint1` twice, as entries 1 and 3 of `name`",
        ),
        (
            fed(&|fed| fed.not_finite = 7500),
            "joint1 joint2",
            "NaN or infinity",
        ),
        (
            fed(&|fed| fed.stale = 7500),
            "joint1 joint2",
            "do not advance",
        ),
    ] {
        let trouble = diagnose(&expected, &fed, &seen(&[("demo/joint_states", joints)]));
        assert!(trouble.what.contains(what), "{trouble}");
    }
}

#[test]
fn a_publisher_that_went_is_not_taken_for_a_slip() {
    let fed = Fed {
        was_well: true,
        ..Fed::default()
    };
    let other = seen(&[(&rmw("joint_state", 0), "joint1 joint2")]);
    let trouble = diagnose(&expected(Keys::RmwZenoh, None), &fed, &other);
    assert!(
        trouble.what.starts_with("the publisher of 0/joint_states/"),
        "{trouble}"
    );
    let likely = trouble.likely.unwrap_or_default();
    assert!(likely.contains("the driver has ended"), "{likely}");
}

#[test]
fn only_where_publishers_announce_themselves_has_one_gone() {
    let fed = Fed {
        was_well: true,
        ..Fed::default()
    };
    let nothing = || seen(&[]);
    let plain = diagnose(&expected(Keys::Ros2dds, None), &fed, &nothing()).to_string();
    assert!(plain.contains("no message on"), "{plain}");
    assert!(plain.contains("paused or ended"), "{plain}");
    let rmw = diagnose(&expected(Keys::RmwZenoh, None), &fed, &nothing()).to_string();
    assert!(rmw.contains("has gone"), "{rmw}");
    assert!(rmw.contains("lost its router"), "{rmw}");
}
