//! A twin's efforts read back from an archive.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

use crate::common::{cell, drain, state, write_bag};
use tauscope_bus::{Source, flags};
use tauscope_ingest::{ArchivedTwin, ArchivedTwinTopics, Config};

const MS: i64 = 1_000_000;

#[test]
fn what_the_twin_said_comes_back_by_its_stamp() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut messages = Vec::new();
    for i in 0..300_i64 {
        let (ns, e) = (1_000_000 * MS + i * 10 * MS, i as f64);
        messages.push((
            "/joint_states",
            ns,
            state(ns, "a b", &[0.1 * e, 0.0], &[e, 2.0 * e]),
        ));
        messages.push((
            "/twin/joint_states",
            ns,
            state(ns, "b a", &[], &[20.0, 10.0]),
        ));
        // The twin's filters settle first, and one residual was lost.
        if i >= 100 && i != 200 {
            messages.push((
                "/residual",
                ns,
                state(ns, "a b", &[], &[e - 10.0, 2.0 * e - 20.0]),
            ));
        }
    }
    write_bag(&path, &messages);
    let topics = ArchivedTwinTopics::default();
    let mut source = ArchivedTwin::open(&path, &topics, &Config::default(), &cell("a b")).unwrap();
    let states = drain(&mut source);
    assert_eq!(states.len(), 300);
    assert_eq!(source.dropped(), 0);
    for (i, state) in states.iter().enumerate() {
        let e = i as f64;
        assert_eq!(state.effort[..2], [e, 2.0 * e]);
        assert_eq!(state.expected_effort[..2], [10.0, 20.0]);
        let ready = i >= 100 && i != 200;
        assert_eq!(state.header.has(flags::READY), ready, "{i}");
        let residual = if ready {
            [e - 10.0, 2.0 * e - 20.0]
        } else {
            [0.0; 2]
        };
        assert_eq!(state.residual[..2], residual);
        let difference = state.filtered_effort[1] - state.filtered_expected_effort[1];
        assert_eq!(difference, residual[1]);
    }
    // 10 rad/s, and no acceleration once the derivatives have settled.
    let last = states[299];
    assert!((last.velocity[0] - 10.0).abs() < 1e-6 && last.acceleration[0].abs() < 1e-3);
}

#[test]
fn an_archive_without_a_twin_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write_bag(
        &path,
        &[("/joint_states", MS, state(MS, "a", &[0.0], &[0.0]))],
    );
    let topics = ArchivedTwinTopics::default();
    let error = ArchivedTwin::open(&path, &topics, &Config::default(), &cell("a")).unwrap_err();
    assert!(error.is_input());
    assert!(error.to_string().contains("/twin/joint_states"), "{error}");
}
