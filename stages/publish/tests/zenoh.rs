//! Messages to a subscriber on Zenoh: ROS 2 as `rmw_zenoh` sends it, and JSON.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

mod common;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use common::{endpoint, feed, publisher, says, session, twin, until};
use tauscope_archive::ros::{self, Message};
use tauscope_bus::{SampleRef, Sink};
use tauscope_publish::Publisher;
use zenoh::{Session, Wait};

/// Payload and attachment of each message, by key.
type Heard = Arc<Mutex<BTreeMap<String, Vec<(Vec<u8>, Vec<u8>)>>>>;

fn listen(session: &Session, key: &str) -> Heard {
    let heard = Heard::default();
    let into = heard.clone();
    session
        .declare_subscriber(key.to_owned())
        .callback(move |sample| {
            let payload = sample.payload().to_bytes().into_owned();
            let attachment = sample.attachment().map(|a| a.to_bytes().into_owned());
            let mut heard = into.lock().unwrap();
            let all = heard.entry(sample.key_expr().to_string()).or_default();
            all.push((payload, attachment.unwrap_or_default()));
        })
        .background()
        .wait()
        .unwrap();
    heard
}

fn ros_key<M: Message>(topic: &str) -> String {
    format!("7/press_1/{topic}/{}/{}", M::dds_type(), M::TYPE_HASH)
}

/// Returns all messages received on a topic.
fn said<M: Message>(heard: &Heard, topic: &str) -> Vec<M> {
    let heard = heard.lock().unwrap();
    let bodies = heard.get(&ros_key::<M>(topic)).into_iter().flatten();
    bodies.map(|(body, _)| ros::decode(body).unwrap()).collect()
}

/// Number of rounds without a further topic after which all are matched: zenoh matches each topic by itself.
const SETTLED_ROUNDS: u32 = 30;

/// Returns a publisher in the state free, with a subscriber matched on all its topics.
fn heard_publisher(key: &str) -> (Publisher, Session, Heard) {
    let endpoint = endpoint();
    let mut publisher = publisher(
        &format!("{{zenoh: {{listen: [{endpoint}], ros2: {{domain: 7}}}}, stop_after_s: 10}}"),
        None,
    );
    let session = session(&endpoint);
    let heard = listen(&session, key);
    let mut ms = -1_000_000;
    let (mut topics, mut rounds) = (0, 0);
    until("heard", || {
        ms += 200;
        feed(&mut publisher, &says(ms, "free"));
        let now = heard.lock().unwrap().len();
        rounds = if now == topics { rounds + 1 } else { 0 };
        topics = now;
        topics > 0 && rounds >= SETTLED_ROUNDS
    });
    (publisher, session, heard)
}

#[test]
fn ros_2_hears_a_contact() {
    let (mut publisher, _session, heard) = heard_publisher("7/**");
    publisher
        .accept("twin", SampleRef::TwinState(&twin(5)))
        .unwrap();
    feed(&mut publisher, &says(5, "contact"));
    feed(&mut publisher, &says(10, "free"));
    until("free again", || {
        let free: Vec<ros::Bool> = said(&heard, "free");
        let said: Vec<bool> = free.iter().map(|free| free.data).collect();
        said.windows(3).any(|three| three == [true, false, true])
    });
    // Topics arrive in any order; once this one is here, those checked below are too.
    until("diagnosed", || {
        let all: Vec<ros::DiagnosticArray> = said(&heard, "diagnostics");
        let words = |array: &ros::DiagnosticArray| array.status[0].message == "contact";
        all.iter().any(words)
    });
    let words = || -> Vec<String> {
        let events: Vec<ros::DiagnosticArray> = said(&heard, "detections");
        let first = |event: &ros::DiagnosticArray| event.status[0].message.clone();
        events.iter().map(first).collect()
    };
    until("both told", || {
        words().ends_with(&["contact at upper".into(), "free".into()])
    });
    let contact: Vec<ros::Bool> = said(&heard, "contact");
    assert_eq!(contact.iter().filter(|contact| contact.data).count(), 1);
    let residual: Vec<ros::JointState> = said(&heard, "residual");
    assert_eq!(residual[0].name, ["hinge"]);
    assert_eq!(residual[0].effort, [0.125]);
    let twin: Vec<ros::JointState> = said(&heard, "twin/joint_states");
    assert_eq!(twin[0].effort, [2.5]);
    let force: Vec<ros::Float64> = said(&heard, "external_force");
    assert_eq!(force, [ros::Float64 { data: 5.0 }]);
    let score: Vec<ros::Float64> = said(&heard, "detections/twin_regression/score");
    assert!(score.len() >= 2 && score[0].data.to_bits() == 0.5_f64.to_bits());

    let wrench: Vec<ros::WrenchStamped> = said(&heard, "contact_wrench");
    assert_eq!(wrench[0].header.frame_id, "upper");
    assert_eq!(wrench[0].header.stamp.ns(), 1_700_000_000_005_000_000);
    // The point is one metre from the link's origin along x.
    assert_eq!(<[f64; 3]>::from(wrench[0].wrench.force), [0.0, 3.0, 4.0]);
    assert_eq!(<[f64; 3]>::from(wrench[0].wrench.torque), [0.0, -4.0, 3.0]);
    let wrench: Vec<ros::WrenchStamped> = said(&heard, "external_wrench");
    assert_eq!(wrench[0].header.frame_id, "base");
    assert_eq!(<[f64; 3]>::from(wrench[0].wrench.torque), [-3.0, -4.0, 3.0]);
}

#[test]
fn messages_of_a_topic_are_numbered_as_rmw_zenoh_numbers_them() {
    let (mut publisher, _session, heard) = heard_publisher("7/**");
    let key = ros_key::<ros::Bool>("free");
    let count = || heard.lock().unwrap().get(&key).map_or(0, Vec::len);
    let before = count();
    for ms in 0..20 {
        feed(
            &mut publisher,
            &says(ms, if ms % 2 == 0 { "contact" } else { "free" }),
        );
    }
    until("all heard", || count() >= before + 20);
    let heard = heard.lock().unwrap();
    let attachments: Vec<&Vec<u8>> = heard[&key]
        .iter()
        .map(|(_, attachment)| attachment)
        .collect();
    let number = |bytes: &[u8]| i64::from_le_bytes(bytes[..8].try_into().unwrap());
    for pair in attachments.windows(2) {
        assert_eq!(number(pair[1]), number(pair[0]) + 1);
        assert_eq!((pair[0].len(), pair[0][16]), (33, 16));
        assert_eq!(pair[0][17..], pair[1][17..], "one publisher");
        assert!(
            number(&pair[0][8..]) <= number(&pair[1][8..]),
            "time runs on"
        );
    }
}

#[test]
fn ros_2_sees_the_node_and_its_topics() {
    let (publisher, session, _heard) = heard_publisher("7/**");
    let tokens = || {
        let replies = session.liveliness().get("@ros2_lv/7/**").wait().unwrap();
        let tokens: Vec<String> = replies
            .iter()
            .filter_map(|reply| Some(reply.result().ok()?.key_expr().to_string()))
            .collect();
        tokens
    };
    until("announced", || tokens().len() >= 11);
    let tokens = tokens();
    let node = |token: &&String| token.ends_with("/NN/%/%press_1/tauscope");
    assert_eq!(tokens.iter().filter(node).count(), 1, "{tokens:#?}");
    let free = format!(
        "/MP/%/%press_1/tauscope/%press_1%free/{}/{}/::,10:,:,:,,",
        ros::Bool::dds_type(),
        ros::Bool::TYPE_HASH
    );
    assert!(
        tokens.iter().any(|token| token.ends_with(&free)),
        "{tokens:#?}"
    );
    drop(publisher);
}

#[test]
fn json_says_the_same() {
    let (mut publisher, _session, heard) = heard_publisher("press-1/**");
    feed(&mut publisher, &says(5, "collision"));
    feed(&mut publisher, &says(10, "free"));
    let alarms = || -> Vec<serde_json::Value> {
        let heard = heard.lock().unwrap();
        let bodies = heard.get("press-1/alarm").into_iter().flatten();
        bodies
            .map(|(body, _)| serde_json::from_slice(body).unwrap())
            .collect()
    };
    until("the collision has ended", || {
        alarms().last().is_some_and(|last| last["contact"] == false)
            && alarms().iter().any(|a| a["contact"] == true)
    });
    let all = alarms();
    let last = all.last().unwrap();
    assert_eq!(
        (&last["state"], &last["free"]),
        (&"collision".into(), &false.into()),
        "it stays"
    );
    let touched = all.iter().find(|alarm| alarm["contact"] == true).unwrap();
    assert_eq!(touched["link"], "upper");
    assert_eq!(touched["force_n"], serde_json::json!([0.0, 3.0, 4.0]));
    let collisions = || -> Vec<serde_json::Value> {
        let heard = heard.lock().unwrap();
        let detections = heard.get("press-1/detections/twin_regression");
        let bodies = detections.into_iter().flatten();
        let all =
            bodies.map(|(body, _)| serde_json::from_slice::<serde_json::Value>(body).unwrap());
        all.filter(|said| said["state"] == "collision").collect()
    };
    until("the detection is told", || !collisions().is_empty());
    let collisions = collisions();
    assert_eq!(collisions.len(), 1);
    assert_eq!(collisions[0]["joints"], serde_json::json!(["hinge"]));
}

#[test]
fn silence_reads_as_stop() {
    let endpoint = endpoint();
    let mut publisher = publisher(
        &format!("{{zenoh: {{listen: [{endpoint}]}}, stop_after_s: 0.3}}"),
        None,
    );
    let session = session(&endpoint);
    let heard = listen(&session, "press-1/alarm");
    let newest = || -> Option<serde_json::Value> {
        let heard = heard.lock().unwrap();
        let (body, _) = heard.get("press-1/alarm")?.last()?;
        serde_json::from_slice(body).ok()
    };
    let mut ms = 0;
    until("free", || {
        ms += 100;
        feed(&mut publisher, &says(ms, "free"));
        newest().is_some_and(|alarm| alarm["free"] == true)
    });
    // No further sample, only the idle calls of the shell.
    std::thread::sleep(Duration::from_millis(350));
    until("silent", || {
        publisher.idle().unwrap();
        newest().is_some_and(|alarm| alarm["state"] == "silent" && alarm["free"] == false)
    });
    feed(&mut publisher, &says(ms + 100, "free"));
    until("free again", || {
        newest().is_some_and(|alarm| alarm["free"] == true)
    });
    publisher.finish().unwrap();
    until("ended", || {
        newest().is_some_and(|alarm| alarm["state"] == "silent")
    });
}
