//! Shared helpers: a publisher, samples for it, and endpoints.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::net::TcpListener;
use std::time::{Duration, Instant};

use tauscope_bus::command::{Answer, Request};
use tauscope_bus::{
    Detection, Emit, Header, JointState, LinkError, Progress, SampleKind, SampleRef, Sink, Source,
    StageError, TwinState, ZenohEndpoints, flags,
};
use tauscope_dynamics::Model;
use tauscope_publish::{Config, Facts, Publisher, Setup, StreamInfo};

/// Timeout of a test; generous, since slow machines run the tests too.
pub const PATIENCE: Duration = Duration::from_secs(30);
pub const CELL: &str = "press-1";

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="hinge" type="revolute"><origin xyz="0 0 1"/><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="50"/></joint></robot>"#;

/// Returns an endpoint without a listener.
pub fn endpoint() -> String {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/127.0.0.1:{}", free.local_addr().unwrap().port())
}

/// Opens a session that connects to an endpoint.
pub fn session(endpoint: &str) -> zenoh::Session {
    let endpoints = ZenohEndpoints {
        listen: Vec::new(),
        connect: vec![endpoint.to_owned()],
    };
    endpoints.session().unwrap()
}

/// Creates a publisher of one detector, `twin_regression` of the stage `detect`.
pub fn publisher(yaml: &str, commands: Option<&str>) -> Publisher {
    made(yaml, commands, false)
}

/// Creates a publisher like [`publisher`] without commands, restarted after a crash.
pub fn restarted(yaml: &str) -> Publisher {
    made(yaml, None, true)
}

fn made(yaml: &str, commands: Option<&str>, restarted: bool) -> Publisher {
    let config: Config = serde_saphyr::from_str(yaml).unwrap();
    let stream = |stage: &str, kind| StreamInfo {
        stage: stage.to_owned(),
        kind,
        detector: (stage == "detect").then(|| "twin_regression".to_owned()),
        judges_contact: true,
    };
    let setup = Setup {
        cell: CELL.to_owned(),
        joint_names: vec!["hinge".to_owned()],
        model: Some(Model::from_urdf(ARM).unwrap()),
        streams: vec![
            stream("ingest", SampleKind::JointState),
            stream("twin", SampleKind::TwinState),
            stream("detect", SampleKind::Detection),
        ],
        commands: commands.map(|endpoint| ZenohEndpoints {
            listen: vec![endpoint.to_owned()],
            connect: Vec::new(),
        }),
        facts: Facts::default(),
        restarted,
    };
    Publisher::new(&config, &setup).unwrap()
}

fn header(ms: i64, flags: u32) -> Header {
    Header {
        stamp_ns: 1_700_000_000_000_000_000 + ms * 1_000_000,
        sequence: ms as u64,
        flags,
        joint_count: 1,
        ..Header::default()
    }
}

/// Returns the twin's part of a sample.
pub fn twin(ms: i64) -> TwinState {
    let mut twin = TwinState {
        header: header(ms, flags::READY),
        ..TwinState::default()
    };
    twin.expected_effort[0] = 2.5;
    twin.residual[0] = 0.125;
    twin
}

/// Returns a detection in the state `free`, `contact` or `collision`. A contact is a push of 5 N at the upper link.
pub fn says(ms: i64, state: &str) -> Detection {
    let touched = state != "free";
    let alarm = flags::ALARM | flags::FORCE;
    Detection {
        header: header(ms, flags::READY | if touched { alarm } else { 0 }),
        detector: "twin_regression".into(),
        state: state.into(),
        link: if touched { "upper" } else { "" }.into(),
        force_n: if touched { [0.0, 3.0, 4.0] } else { [0.0; 3] },
        point_m: [1.0, 0.0, 1.0],
        score: 0.5,
        threshold: 4.0,
        joints: u32::from(touched),
        ..Detection::default()
    }
}

/// Feeds a detection.
pub fn feed(publisher: &mut Publisher, detection: &Detection) {
    publisher
        .accept("detect", SampleRef::Detection(detection))
        .unwrap();
}

/// Repeats `step` until it returns true.
pub fn until(what: &str, mut step: impl FnMut() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !step() {
        assert!(Instant::now() < deadline, "never: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// An endless source of joint states.
#[derive(Default)]
pub struct States(i64);

impl Source<JointState> for States {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        self.0 += 1;
        let ms = self.0;
        out.emit(&mut |slot| slot.header = header(ms, 0))?;
        Ok(Progress::More)
    }
}

/// Buffer of emitted samples.
#[derive(Default)]
pub struct Collect(pub Vec<JointState>);

impl Emit<JointState> for Collect {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let mut slot = JointState::default();
        write(&mut slot);
        self.0.push(slot);
        Ok(())
    }
}

/// A source that gives each command the same answer and forwards its request, until it is dropped.
pub struct Answering {
    _session: zenoh::Session,
    pub asked: std::sync::mpsc::Receiver<Request>,
}

impl Answering {
    pub fn at(endpoint: &str, answer: &Answer) -> Self {
        use zenoh::Wait as _;
        let endpoints = ZenohEndpoints {
            listen: vec![endpoint.to_owned()],
            connect: Vec::new(),
        };
        let session = endpoints.session().unwrap();
        let (tell, asked) = std::sync::mpsc::channel();
        let json = serde_json::to_string(answer).unwrap();
        session
            .declare_queryable(tauscope_bus::command::key(CELL))
            .callback(move |question| {
                let request = question.payload().unwrap().to_bytes();
                tell.send(Request::from_json(&request).unwrap()).unwrap();
                question
                    .reply(question.key_expr().clone(), json.clone())
                    .wait()
                    .unwrap();
            })
            .background()
            .wait()
            .unwrap();
        Self {
            _session: session,
            asked,
        }
    }
}
