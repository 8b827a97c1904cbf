//! Foreign messages: ROS 2, a fleet's cells, commands of people, a PLC.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::OnceLock;
use std::time::Duration;

use tauscope_archive::ros::{self, JointStateDecoder};
use tauscope_bus::SampleKind;
use tauscope_bus::command::{Request, Signed};
use tauscope_fleet::inbox;
use tauscope_fleet::wall::{Now, Wall};
use tauscope_publish::{Config, Facts, Publisher, Setup, StreamInfo};

/// A message of ROS 2, decoded as each supported type.
pub fn cdr(bytes: &[u8]) {
    let _ = ros::decode::<ros::JointState>(bytes);
    let _ = ros::decode::<ros::DynamicJointState>(bytes);
    let _ = ros::decode::<ros::DiagnosticArray>(bytes);
    let _ = ros::decode::<ros::WrenchStamped>(bytes);
    let _ = ros::decode::<ros::InertiaStamped>(bytes);
    let _ = ros::decode::<ros::Float64>(bytes);
    let _ = ros::decode::<ros::Bool>(bytes);
    let mut decoder = JointStateDecoder::default();
    let _ = decoder.guess_into(bytes, &mut ros::JointState::default());
}

/// A message of a cell to its fleet: a key, a line break, a payload. Valid ones go to the wall.
pub fn status(bytes: &[u8]) {
    let at = bytes.iter().position(|&byte| byte == b'\n');
    let (key, payload) = bytes.split_at(at.unwrap_or(bytes.len().min(32)));
    let key = String::from_utf8_lossy(key);
    let payload = payload.get(1..).unwrap_or_default();
    let mut wall = Wall::new(["press-1".to_owned()]);
    let now = Now::default();
    let _ = inbox::token(&key);
    let mut events = inbox::records(&key, payload);
    events.push(inbox::record(&key, payload));
    events.push(inbox::status(&key, payload));
    events.push(inbox::answer(&key, payload));
    for event in events {
        wall.take(event, now);
    }
    wall.tick(now);
    let _ = serde_json::to_string(&wall.snapshot());
}

/// A command: parsed from JSON, checked, and read again from an archive.
pub fn command(bytes: &[u8]) {
    let _ = Request::from_json(bytes).and_then(|request| request.command());
    let signed = Signed::from_json(bytes);
    let Ok(command) = signed.and_then(|signed| signed.command()) else {
        return;
    };
    let arguments = command.arguments();
    let find = |name: &str| {
        let found = arguments.iter().find(|(key, _)| *key == name);
        found.map(|(_, value)| value.as_str())
    };
    let verb = command.verb().map_or("", |verb| verb.as_str());
    assert_eq!(Request::archived(verb, find), Ok(command), "archived");
}

/// Bytes of a client of the Modbus server, which must keep answering afterwards.
pub fn modbus(bytes: &[u8]) {
    let mut plc = connect();
    // The server may disconnect at any time.
    let _ = plc
        .write_all(bytes)
        .and_then(|()| plc.shutdown(Shutdown::Write));
    let mut answer = Vec::new();
    let _ = plc.read_to_end(&mut answer);
    drop(plc);

    let read_one_coil = [0, 7, 0, 0, 0, 6, 1, 1, 0, 0, 0, 1];
    let mut plc = connect();
    let mut answer = [0; 10];
    plc.write_all(&read_one_coil).expect("the server hears");
    plc.read_exact(&mut answer).expect("the server answers");
    assert_eq!(answer[..8], [0, 7, 0, 0, 0, 4, 1, 1], "{answer:?}");
}

fn connect() -> TcpStream {
    let stream = TcpStream::connect(server()).expect("the server takes a client");
    let patience = Some(Duration::from_secs(5));
    stream.set_read_timeout(patience).expect("a socket option");
    stream.set_nodelay(true).expect("a socket option");
    stream
}

/// Address of a publisher's Modbus server that runs as long as the process.
fn server() -> SocketAddr {
    static PUBLISHER: OnceLock<SocketAddr> = OnceLock::new();
    *PUBLISHER.get_or_init(|| {
        let config = serde_json::json!({"modbus": {"listen": "127.0.0.1:0"}});
        let config: Config = serde_json::from_value(config).expect("a configuration");
        let setup = Setup {
            cell: "press-1".to_owned(),
            joint_names: vec!["hinge".to_owned()],
            model: None,
            streams: vec![StreamInfo {
                stage: "detect".to_owned(),
                kind: SampleKind::Detection,
                detector: None,
                judges_contact: true,
            }],
            commands: None,
            facts: Facts::default(),
            restarted: false,
        };
        let publisher = Publisher::new(&config, &setup).expect("a publisher");
        let address = publisher.modbus_address().expect("a Modbus server");
        std::mem::forget(publisher);
        address
    })
}
