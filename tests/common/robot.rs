//! A robot on Zenoh: a router in this process, and publishers like those of ROS 2.

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU16, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use tauscope_archive::ros::{self, Message as _};
use zenoh::{Session, Wait as _};

/// The joints of the bundled robot.
pub const JOINTS: [&str; 7] = [
    "joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "joint7",
];

/// An endpoint without a listener, below Linux's range of ephemeral ports, so that no connection takes the port in
/// the meantime.
pub fn endpoint() -> String {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    loop {
        let spread = (std::process::id() % 1000) as u16 * 10;
        let port = 20_000 + (spread + NEXT.fetch_add(1, Ordering::Relaxed)) % 12_000;
        if TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return format!("tcp/127.0.0.1:{port}");
        }
    }
}

/// Starts a router that listens there.
pub fn router(endpoint: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"router\"".to_owned()),
        ("listen/endpoints", format!("[\"{endpoint}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

/// Key of a topic in `rmw_zenoh`.
pub fn rmw_key(domain: u32, topic: &str) -> String {
    let (dds_type, hash) = (ros::JointState::dds_type(), ros::JointState::TYPE_HASH);
    format!("{domain}/{topic}/{dds_type}/{hash}")
}

/// Liveliness token by which `rmw_zenoh` announces a publisher.
pub fn rmw_token(domain: u32, topic: &str) -> String {
    let (dds_type, hash) = (ros::JointState::dds_type(), ros::JointState::TYPE_HASH);
    let topic = topic.replace('/', "%");
    format!("@ros2_lv/{domain}/abc/0/10/MP/%/%/driver/%{topic}/{dds_type}/{hash}/::,7:,:,:,,")
}

/// Publishes joint states, a hundred per second, until it is dropped.
pub struct Publisher {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Publisher {
    /// Starts publishing these joints under this key.
    pub fn start(session: &Session, key: &str, joints: &[&str]) -> Self {
        Self::start_as(session, key, joints, None)
    }

    /// Starts publishing with the sequence number and name that `rmw_zenoh` attaches.
    pub fn start_as(session: &Session, key: &str, joints: &[&str], id: Option<u8>) -> Self {
        let body = |joints: &[String]| {
            let now = SystemTime::now()
                .duration_since(SystemTime::UNIX_EPOCH)
                .unwrap();
            let zeros = vec![0.0; joints.len()];
            let mut state = ros::JointState {
                name: joints.to_vec(),
                position: zeros.clone(),
                velocity: zeros.clone(),
                effort: zeros,
                ..ros::JointState::default()
            };
            // The effort must vary, because constant values are reported as a fault.
            state.effort[0] = f64::from(now.subsec_nanos()) * 1e-12;
            state.header.stamp.sec = now.as_secs() as i32;
            state.header.stamp.nanosec = now.subsec_nanos();
            let mut body = Vec::new();
            ros::encode(&state, &mut body).unwrap();
            body
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (stopped, session, key) = (Arc::clone(&stop), session.clone(), key.to_owned());
        let joints: Vec<String> = joints.iter().map(ToString::to_string).collect();
        let thread = std::thread::spawn(move || {
            let mut sequence = 0_i64;
            while !stopped.load(Ordering::Relaxed) {
                let put = session.put(&key, body(&joints));
                match id {
                    Some(id) => put.attachment(attachment(sequence, id)).wait().unwrap(),
                    None => put.wait().unwrap(),
                }
                sequence += 1;
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        Self {
            stop,
            thread: Some(thread),
        }
    }
}

/// Attachment of `rmw_zenoh`: number, time and publisher.
fn attachment(sequence: i64, publisher: u8) -> Vec<u8> {
    let mut bytes = sequence.to_le_bytes().to_vec();
    bytes.extend(0_i64.to_le_bytes());
    bytes.push(16);
    bytes.extend([publisher; 16]);
    bytes
}

impl Drop for Publisher {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}
