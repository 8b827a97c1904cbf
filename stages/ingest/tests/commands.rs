//! Commands over Zenoh in the samples of a source.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::common::{Collect, cell};
use tauscope_bus::command::{Answer, Request, ask, key};
use tauscope_bus::{Emit, JointState, Progress, Source, StageError, Verb, ZenohEndpoints, flags};
use tauscope_ingest::{Commanded, Setup, Takes};
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(30);

/// Joint states, one a millisecond, or none.
struct States {
    ms: i64,
    runs: bool,
}

impl Source<JointState> for States {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        std::thread::sleep(Duration::from_millis(1));
        if self.runs {
            self.ms += 1;
            out.emit(&mut |slot| slot.header.stamp_ns = self.ms * 1_000_000)?;
        }
        Ok(Progress::More)
    }
}

fn commanded(runs: bool, has_tool_link: bool) -> (Commanded, Session) {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", free.local_addr().unwrap());
    drop(free);
    let endpoints = |listen: &[&String], connect: &[&String]| ZenohEndpoints {
        listen: listen.iter().map(ToString::to_string).collect(),
        connect: connect.iter().map(ToString::to_string).collect(),
    };
    let setup = Setup {
        has_tool_link,
        ..cell("a b")
    };
    let states = Box::new(States { ms: 0, runs });
    let takes = Takes {
        learn: has_tool_link,
        arm_kg: Some(30.0),
    };
    let source = Commanded::live(states, &setup, &endpoints(&[&endpoint], &[]), takes).unwrap();
    (source, endpoints(&[], &[&endpoint]).session().unwrap())
}

/// Sends a request while the source runs; returns the answer, and the samples emitted meanwhile.
fn asked(source: &mut Commanded, session: &Session, request: Request) -> (Answer, Vec<JointState>) {
    let session = session.clone();
    let asking = std::thread::spawn(move || ask(&session, "demo", &request, PATIENCE).unwrap());
    let mut out = Collect(Vec::new());
    while !asking.is_finished() {
        source.step(&mut out).unwrap();
    }
    (asking.join().unwrap(), out.0)
}

fn refusal(answer: &Answer) -> &str {
    match answer {
        Answer::Refused { reason } => reason,
        Answer::Taken { .. } => panic!("it was taken"),
    }
}

#[test]
fn the_answer_is_the_stamp_of_the_sample_that_carries_the_command() {
    let (mut source, session) = commanded(true, true);
    let payload = Request::Payload {
        mass_kg: 1.5,
        com_m: [0.0, 0.0, 0.25],
    };
    let (answer, samples) = asked(&mut source, &session, payload);
    let carries = |sample: &&JointState| sample.command.verb() == Some(Verb::Payload);
    let carriers: Vec<&JointState> = samples.iter().filter(carries).collect();
    assert_eq!(carriers.len(), 1, "one sample");
    let stamp_ns = carriers[0].header.stamp_ns;
    assert_eq!(answer, Answer::Taken { stamp_ns });
    for sample in &samples {
        let carried = sample.header.stamp_ns >= stamp_ns;
        assert_eq!(sample.header.has(flags::TOOL), carried);
        assert_eq!(
            sample.tool_mass_kg.to_bits(),
            if carried { 1.5_f64 } else { 0.0 }.to_bits()
        );
    }
}

#[test]
fn what_cannot_hold_is_refused_and_no_sample_carries_it() {
    let (mut source, session) = commanded(true, false);
    let payload = Request::Payload {
        mass_kg: 1.5,
        com_m: [0.0; 3],
    };
    let (answer, samples) = asked(&mut source, &session, payload);
    assert!(
        refusal(&answer).contains("which link carries a tool"),
        "{answer:?}"
    );
    let (answer, more) = asked(&mut source, &session, Request::Mute { seconds: 61.0 });
    assert!(
        refusal(&answer).contains("a mute lasts 0 to 60 s"),
        "{answer:?}"
    );
    assert!(
        samples
            .iter()
            .chain(&more)
            .all(|sample| sample.command.verb().is_none())
    );
}

#[test]
fn learning_is_refused_where_nothing_learns_and_a_payload_that_the_arm_cannot_carry() {
    let (mut source, session) = commanded(true, false);
    let (answer, samples) = asked(&mut source, &session, Request::Learn);
    assert!(refusal(&answer).contains("no detector of this cell learns"));
    assert!(samples.iter().all(|s| s.command.verb().is_none()));
    let (mut source, session) = commanded(true, true);
    let (answer, _) = asked(&mut source, &session, Request::Learn);
    assert!(matches!(answer, Answer::Taken { .. }), "{answer:?}");
    let heavy = Request::Payload {
        mass_kg: 31.0,
        com_m: [0.0; 3],
    };
    let (answer, _) = asked(&mut source, &session, heavy);
    assert!(refusal(&answer).contains("30.0 kg"), "{answer:?}");
}

#[test]
fn without_samples_a_command_is_refused_soon_and_holds_never() {
    let (mut source, session) = commanded(false, true);
    let (answer, samples) = asked(&mut source, &session, Request::Acknowledge);
    assert!(
        refusal(&answer).contains("no joint state came"),
        "{answer:?}"
    );
    assert!(samples.is_empty());
}

#[test]
fn a_message_is_a_command_too_and_each_sample_carries_one_at_most() {
    let (mut source, session) = commanded(true, true);
    // An answer means that the sessions are connected.
    asked(&mut source, &session, Request::Learn);
    for seconds in [1, 2, 3] {
        let json = format!(r#"{{"verb": "mute", "seconds": {seconds}}}"#);
        session.put(key("demo"), json).wait().unwrap();
    }
    session.put(key("demo"), "no JSON").wait().unwrap();
    let mut out = Collect(Vec::new());
    let begin = Instant::now();
    let taken = |out: &Collect<JointState>| -> Vec<f64> {
        let commands = out.0.iter().map(|sample| sample.command);
        let mutes = commands.filter(|command| command.verb() == Some(Verb::Mute));
        mutes.map(|command| command.value).collect()
    };
    while taken(&out).len() < 3 && begin.elapsed() < PATIENCE {
        source.step(&mut out).unwrap();
    }
    assert_eq!(taken(&out), [1.0, 2.0, 3.0]);
}
