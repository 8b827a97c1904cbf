//! The router file that `deploy/zenoh/secure.sh` writes, in a real router with live sessions: a session's certificate
//! determines the messages that the router forwards.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use crate::common::{live, robot};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use zenoh::handlers::FifoChannelHandler;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait as _};

/// Time within which a forwarded message arrives.
const SOON: Duration = Duration::from_secs(10);

/// Certificates for two cells, and their router; `None` without `openssl`.
fn router(folder: &Path, test: &str) -> Option<(Session, String)> {
    if Command::new("openssl").arg("version").output().is_err() {
        crate::common::skipped(test, "openssl is absent");
        return None;
    }
    secure(folder);
    let mut config = zenoh::Config::from_file(folder.join("router.json5")).unwrap();
    let endpoint = robot::endpoint().replace("tcp/", "tls/");
    // The file's paths are relative to its own folder, and this test runs in another one.
    for key in [
        "root_ca_certificate",
        "listen_private_key",
        "listen_certificate",
    ] {
        let key = format!("transport/link/tls/{key}");
        let name = config.get_json(&key).unwrap();
        let path = folder.join(name.trim_matches('"'));
        config
            .insert_json5(&key, &serde_json::json!(path).to_string())
            .unwrap();
    }
    let listen = format!("[\"{endpoint}\"]");
    config.insert_json5("listen/endpoints", &listen).unwrap();
    Some((zenoh::open(config).wait().unwrap(), endpoint))
}

fn secure(folder: &Path) {
    let script = crate::common::root().join("deploy/zenoh/secure.sh");
    let made = Command::new(script)
        .arg(folder)
        .args(["127.0.0.1", "press-1", "press-2"])
        .output()
        .unwrap();
    assert!(made.status.success(), "{made:?}");
}

/// Endpoint of a pipeline file, with the certificate `name` of that folder.
fn with_certificate(endpoint: &str, folder: &Path, name: &str) -> String {
    let file = |name: String| folder.join(name).display().to_string();
    format!(
        "{endpoint}#root_ca_certificate_file={};enable_mtls=true;connect_certificate_file={};\
         connect_private_key_file={}",
        file("ca.pem".to_owned()),
        file(format!("{name}.pem")),
        file(format!("{name}.key"))
    )
}

/// A client that trusts the authority of `authority` and shows the certificate `name` of `own`, if any.
fn client(endpoint: &str, authority: &Path, own: Option<(&Path, &str)>) -> zenoh::Result<Session> {
    let file = |folder: &Path, name: &str| folder.join(name).display().to_string();
    let mut endpoint = format!(
        "{endpoint}#root_ca_certificate_file={}",
        file(authority, "ca.pem")
    );
    if let Some((folder, name)) = own {
        endpoint += &format!(
            ";enable_mtls=true;connect_certificate_file={};connect_private_key_file={}",
            file(folder, &format!("{name}.pem")),
            file(folder, &format!("{name}.key"))
        );
    }
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"client\"".to_owned()),
        ("connect/endpoints", format!("[{endpoint:?}]")),
        ("connect/timeout_ms", "2000".to_owned()),
        ("connect/exit_on_failure", "true".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value)?;
    }
    zenoh::open(config).wait()
}

fn next(from: &FifoChannelHandler<Sample>, begin: &str) -> Sample {
    let deadline = Instant::now() + SOON;
    while let Some(sample) = from.recv_deadline(deadline).unwrap() {
        if sample.key_expr().as_str().starts_with(begin) {
            return sample;
        }
    }
    panic!("nothing under {begin}");
}

#[test]
fn a_cell_speaks_and_hears_under_its_own_name_only() {
    let test = "a_cell_speaks_and_hears_under_its_own_name_only";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let open = |name| client(&endpoint, folder, Some((folder, name))).unwrap();
    let (fleet, one, two) = (open("fleet"), open("press-1"), open("press-2"));

    let fleet_hears = fleet.declare_subscriber("*/**").wait().unwrap();
    let two_hears = two.declare_subscriber("**").wait().unwrap();
    let one_hears = one.declare_subscriber("press-1/**").wait().unwrap();
    std::thread::sleep(Duration::from_secs(1));

    // The forged message is sent first, so it would arrive before the other one if it were forwarded.
    two.put("press-1/status", "forged").wait().unwrap();
    two.put("press-2/status", "second").wait().unwrap();
    let heard = next(&fleet_hears, "");
    assert_eq!(heard.key_expr().as_str(), "press-2/status");
    one.put("press-1/status", "first").wait().unwrap();
    let heard = next(&fleet_hears, "press-1");
    assert_eq!(heard.payload().try_to_string().unwrap(), "first");
    let heard = next(&one_hears, "press-1");
    assert_eq!(heard.payload().try_to_string().unwrap(), "first");
    // Another cell receives none of it, whatever it subscribes to. Its own messages do not pass through the router.
    let mut overheard = Vec::new();
    while let Some(sample) = two_hears.recv_timeout(Duration::from_secs(1)).unwrap() {
        overheard.push(sample.payload().try_to_string().unwrap().into_owned());
    }
    assert_eq!(overheard, ["forged", "second"]);
}

#[test]
fn only_the_fleet_host_commands_a_cell_and_sees_that_it_is_there() {
    let test = "only_the_fleet_host_commands_a_cell_and_sees_that_it_is_there";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let open = |name| client(&endpoint, folder, Some((folder, name))).unwrap();
    let (fleet, one, two) = (open("fleet"), open("press-1"), open("press-2"));

    let tokens = fleet.liveliness().declare_subscriber("*/@alive/*");
    let tokens = tokens.history(true).wait().unwrap();
    let token = one.liveliness().declare_token("press-1/@alive/7");
    let token = token.wait().unwrap();
    let there = next(&tokens, "press-1/@alive/7");
    assert_eq!(there.kind(), SampleKind::Put);

    let commands = one.declare_queryable("press-1/commands").callback(|query| {
        query.reply("press-1/commands", "taken").wait().unwrap();
    });
    let _commands = commands.wait().unwrap();
    std::thread::sleep(Duration::from_secs(1));
    let ask = |session: &Session| {
        let answers = session.get("press-1/commands").timeout(SOON).wait();
        let answers = answers.unwrap();
        answers
            .into_iter()
            .filter(|answer| answer.result().is_ok())
            .count()
    };
    assert_eq!(ask(&two), 0, "another cell");
    assert_eq!(ask(&fleet), 1, "the fleet host");

    token.undeclare().wait().unwrap();
    let gone = next(&tokens, "press-1/@alive/7");
    assert_eq!(gone.kind(), SampleKind::Delete);
}

#[test]
fn who_has_no_certificate_of_the_plant_does_not_get_in() {
    let test = "who_has_no_certificate_of_the_plant_does_not_get_in";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let elsewhere = folder.join("elsewhere");
    secure(&elsewhere);
    assert!(client(&endpoint, folder, None).is_err(), "none");
    let stranger = client(&endpoint, folder, Some((&elsewhere, "press-1")));
    assert!(stranger.is_err(), "a certificate of another authority");
    let plain = endpoint.replace("tls/", "tcp/");
    assert!(client(&plain, folder, None).is_err(), "no TLS at all");
    assert!(client(&endpoint, folder, Some((folder, "press-1"))).is_ok());
}

/// Runs a cell that publishes at that endpoint; returns its output.
fn said_of(endpoint: &str, folder: &Path) -> String {
    let data = crate::common::bundled();
    let data = data.display();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {data}/demo_arm.urdf}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {data}/demo.mcap}}, rate: 0.5}}}}
- {{name: twin, input: ingest, twin: {{model: {data}/demo.twin.yaml}}}}
- {{name: detect, input: twin, detect: {{twin_regression: {{}}}}}}
- {{name: publish, inputs: [ingest, twin, detect], publish: {{zenoh: {{connect: [\"{endpoint}\"]}}}}}}
"
    );
    crate::common::write(&folder.join("pipeline.yaml"), &text);
    live::Live::start(folder, &[]).wait_for_part("no session with ")
}

#[test]
fn a_session_that_cannot_open_is_told_with_its_reason() {
    let test = "a_session_that_cannot_open_is_told_with_its_reason";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let nobody = robot::endpoint();
    let said = said_of(&nobody, folder);
    assert!(said.contains("no answer there"), "{said}");
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let elsewhere = folder.join("elsewhere");
    secure(&elsewhere);
    let file = |folder: &Path, name: &str| folder.join(name).display().to_string();
    let refused = format!(
        "{endpoint}#root_ca_certificate_file={};enable_mtls=true;connect_certificate_file={};\
         connect_private_key_file={}",
        file(folder, "ca.pem"),
        file(&elsewhere, "press-1.pem"),
        file(&elsewhere, "press-1.key")
    );
    let said = said_of(&refused, folder);
    assert!(said.contains("lets no session open"), "{said}");
}

/// Runs a cell on two hosts with that router; the second one uses the certificate `desk`.
fn two_hosts(endpoint: &str, folder: &Path, desk: &str) -> (live::Live, live::Live) {
    let data = crate::common::bundled();
    let data = data.display();
    let robot = with_certificate(endpoint, folder, "press-1");
    let desk = with_certificate(endpoint, folder, desk);
    let text = format!(
        "version: 1
cells: {{press-1: {{robot: {data}/demo_arm.urdf}}}}
hosts: {{robot: {{connect: \"{robot}\"}}, desk: {{connect: \"{desk}\"}}}}
stages:
- {{name: ingest, host: robot, ingest: {{file: {{path: {data}/demo.mcap}}, rate: 4}}}}
- {{name: twin, host: robot, input: ingest, twin: {{}}}}
- {{name: detect, host: desk, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: record, host: desk, inputs: [ingest, twin, detect], record: {{mcap: out.mcap}}}}
"
    );
    crate::common::write(&folder.join("pipeline.yaml"), &text);
    let robot = live::Live::start(folder, &["--host", "robot"]);
    (robot, live::Live::start(folder, &["--host", "desk"]))
}

#[test]
fn two_hosts_of_a_cell_share_its_streams_through_the_router() {
    let test = "two_hosts_of_a_cell_share_its_streams_through_the_router";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let (robot, desk) = two_hosts(&endpoint, folder, "press-1");
    let (code, there) = robot.end();
    assert_eq!(code, 0, "{there}");
    let (code, here) = desk.end();
    assert_eq!(code, 0, "{here}");
    let sent = live::stage(&there, "ingest")["emitted"].as_u64().unwrap();
    assert!(sent > 1000, "{there}");
    assert_eq!(live::stage(&here, "detect")["received"], sent, "{here}");
    assert_eq!(live::stage(&here, "record")["received"], 3 * sent, "{here}");
}

#[test]
fn a_host_with_the_certificate_of_another_cell_gets_nothing_and_says_why_that_may_be() {
    let test = "a_host_with_the_certificate_of_another_cell_gets_nothing_and_says_why_that_may_be";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((_router, endpoint)) = router(folder, test) else {
        return;
    };
    let (mut robot, mut desk) = two_hosts(&endpoint, folder, "press-2");
    robot.wait_for_part("it waits for `detect` on host `desk`");
    desk.wait_for("warning: stage `detect`: no usable sample");
    let likely = desk.wait_for("  likely: ");
    assert!(likely.contains("a certificate of another cell"), "{likely}");
    for host in [robot, desk] {
        live::signal(host.id(), "INT");
        live::signal(host.id(), "INT");
        let (_, summary) = host.end();
        let stages = summary["stages"].as_array().unwrap();
        assert!(
            stages.iter().all(|stage| stage["received"] == 0),
            "{summary}"
        );
    }
}
