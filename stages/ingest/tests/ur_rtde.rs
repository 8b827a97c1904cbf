//! A simulated Universal Robots controller over a real socket.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::common::{Collect, cell, step};
use crate::ur_controller::{Behaviour, Controller, Instant as Measured};
use tauscope_bus::{JointState, Source, Trouble, flags};
use tauscope_ingest::{Config, Setup, UrEffort, UrRtdeConfig, UrRtdeSource};

const PATIENCE: Duration = Duration::from_secs(20);
/// Time within which a live source must report a fault.
const PROMISED: Duration = Duration::from_secs(5);

fn arm() -> Setup {
    cell("base shoulder elbow wrist1 wrist2 wrist3")
}

fn settings(port: u16) -> UrRtdeConfig {
    let text = format!("{{host: 127.0.0.1, port: {port}}}");
    serde_saphyr::from_str(&text).unwrap()
}

fn measured(i: u32) -> Measured {
    let x = f64::from(i);
    Measured {
        timestamp_s: 1000.0 + x * 0.002,
        position: [x, 1.0, 2.0, 3.0, 4.0, 5.0],
        velocity: [0.5, 0.0, 0.0, 0.0, 0.0, -x],
        effort: [0.0, 10.0, 20.0, 30.0, 40.0, x],
        target_moment: [7.0, 0.0, 0.0, 0.0, 0.0, x],
        payload_kg: 1.5,
    }
}

fn open(settings: &UrRtdeConfig) -> UrRtdeSource {
    UrRtdeSource::open(settings, &Config::default(), &arm()).unwrap()
}

fn receive(source: &mut UrRtdeSource, count: usize) -> Vec<JointState> {
    let deadline = Instant::now() + PATIENCE;
    let mut out = Collect(Vec::new());
    while out.0.len() < count {
        assert!(Instant::now() < deadline, "{} of {count} came", out.0.len());
        step(source, &mut out);
    }
    out.0
}

#[test]
fn packages_become_samples_also_in_pieces() {
    for piece in [usize::MAX, 7] {
        let behaviour = Behaviour {
            piece,
            ..Behaviour::default()
        };
        let controller = Controller::start(behaviour, (0..100).map(measured).collect());
        let mut setup = arm();
        setup.has_tool_link = true;
        let settings = UrRtdeConfig {
            target_moment: true,
            payload: true,
            ..settings(controller.port)
        };
        let mut source = UrRtdeSource::open(&settings, &Config::default(), &setup).unwrap();
        let samples = receive(&mut source, 100);
        for (i, sample) in samples.iter().enumerate() {
            let expected = measured(u32::try_from(i).unwrap());
            assert_eq!(sample.position[..6], expected.position);
            assert_eq!(sample.velocity[..6], expected.velocity);
            assert_eq!(sample.effort[..6], expected.effort);
            assert_eq!(sample.reference_effort[..6], expected.target_moment);
            let wanted =
                flags::EFFORT_MEASURED | flags::VELOCITY_MEASURED | flags::REFERENCE | flags::TOOL;
            assert!(sample.header.has(wanted), "{i}");
            assert_eq!(sample.tool_mass_kg, 1.5);
            assert_eq!(sample.tool_com_m, [0.01, 0.02, 0.03]);
            // Order xx, xy, xz, yy, yz, zz; the controller's order is xx, yy, zz, xy, xz, yz.
            assert_eq!(sample.tool_inertia_kgm2, [1.0, 4.0, 5.0, 2.0, 6.0, 3.0]);
            let since_ns = sample.header.stamp_ns - samples[0].header.stamp_ns;
            assert_eq!(since_ns, i as i64 * 2_000_000);
        }
        assert_eq!((source.lost(), source.dropped()), (0, 0));
    }
}

#[test]
fn a_controller_that_goes_is_heard_again() {
    let behaviour = Behaviour {
        closes_after: Some(40),
        ..Behaviour::default()
    };
    // One instant is missing.
    let instants = (0..120).filter(|i| *i != 60).map(measured).collect();
    let controller = Controller::start(behaviour, instants);
    let mut source = open(&settings(controller.port));
    let samples = receive(&mut source, 119);
    let last = samples[118];
    assert_eq!(last.position[0], 119.0);
    let span_ns = last.header.stamp_ns - samples[0].header.stamp_ns;
    assert_eq!(span_ns, 119 * 2_000_000);
    assert_eq!(source.lost(), 1);
}

/// Returns the trouble that a source reports for a controller without data, which must be within [`PROMISED`].
fn said(settings: &UrRtdeConfig) -> Trouble {
    let mut source = open(settings);
    let began = Instant::now();
    let mut out = Collect(Vec::new());
    loop {
        step(&mut source, &mut out);
        if let Some(trouble) = source.trouble(began.elapsed()) {
            assert!(out.0.is_empty());
            return trouble;
        }
        assert!(began.elapsed() < PROMISED, "nothing was said");
    }
}

#[test]
fn each_fault_is_named_with_its_remedy() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let refused = free.local_addr().unwrap().port();
    drop(free);
    let with = |behaviour: Behaviour| Controller::start(behaviour, vec![measured(0)]);
    let other_version = with(Behaviour {
        version: 1,
        ..Behaviour::default()
    });
    let older = with(Behaviour {
        without: vec!["actual_current_as_torque"],
        ..Behaviour::default()
    });
    let nonsense = with(Behaviour {
        says: Some(b"HTTP/1.1 400 Bad Request\r\n"),
        ..Behaviour::default()
    });
    let dumb = with(Behaviour {
        says: Some(b""),
        ..Behaviour::default()
    });
    let standing = with(Behaviour {
        sends: false,
        ..Behaviour::default()
    });
    for (port, what, remedy) in [
        (refused, "connection refused", "RTDE is switched off"),
        (other_version.port, "does not speak version 2", "update"),
        (
            older.port,
            "has no output actual_current_as_torque",
            "effort: actual_current",
        ),
        (nonsense.port, "not as RTDE", "another service"),
        (dumb.port, "does not answer", "another service"),
        (standing.port, "sends nothing", "starting or has stopped"),
    ] {
        let settings = UrRtdeConfig {
            effort: UrEffort::ActualCurrentAsTorque,
            ..settings(port)
        };
        let trouble = said(&settings);
        assert!(trouble.what.contains(what), "{trouble:?}");
        assert!(
            trouble.likely.as_ref().unwrap().contains(remedy),
            "{trouble:?}"
        );
    }
    let settings = UrRtdeConfig {
        host: "no.such.host.invalid".to_owned(),
        ..settings(1)
    };
    let trouble = said(&settings);
    assert!(trouble.likely.unwrap().contains("`host` is misspelt"));
}

#[test]
fn a_payload_without_an_inertia_is_taken_from_an_older_controller() {
    let behaviour = Behaviour {
        without: vec!["payload_inertia"],
        ..Behaviour::default()
    };
    let controller = Controller::start(behaviour, (0..10).map(measured).collect());
    let mut setup = arm();
    setup.has_tool_link = true;
    let settings = UrRtdeConfig {
        payload: true,
        ..settings(controller.port)
    };
    let mut source = UrRtdeSource::open(&settings, &Config::default(), &setup).unwrap();
    let samples = receive(&mut source, 10);
    assert_eq!(samples[9].tool_mass_kg, 1.5);
    assert_eq!(samples[9].tool_inertia_kgm2, [0.0; 6]);
}

#[test]
fn settings_that_do_not_fit_the_cell_are_refused() {
    let refused = |settings: &UrRtdeConfig, setup: &Setup| {
        let error = UrRtdeSource::open(settings, &Config::default(), setup).unwrap_err();
        assert!(error.is_input(), "{error}");
        error.to_string()
    };
    let said = refused(&settings(1), &cell("a b"));
    assert!(said.contains("six joints, found 2"), "{said}");
    let named = UrRtdeConfig {
        joints: Some(["a", "b", "c", "d", "e", "f"].map(str::to_owned).to_vec()),
        ..settings(1)
    };
    let said = refused(&named, &cell("a x"));
    assert!(said.contains("does not name joint `x`"), "{said}");
    let payload = UrRtdeConfig {
        payload: true,
        ..settings(1)
    };
    let said = refused(&payload, &arm());
    assert!(said.contains("needs a `tool`"), "{said}");
}
