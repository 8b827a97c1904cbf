//! A simulated Universal Robots controller that implements RTDE version 2 over a real socket.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "each test program uses its own part, and a test may fail here"
)]

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Its outputs, with their types.
const OUTPUTS: [(&str, &str); 9] = [
    ("timestamp", "DOUBLE"),
    ("actual_q", "VECTOR6D"),
    ("actual_qd", "VECTOR6D"),
    ("actual_current", "VECTOR6D"),
    ("actual_current_as_torque", "VECTOR6D"),
    ("target_moment", "VECTOR6D"),
    ("payload", "DOUBLE"),
    ("payload_cog", "VECTOR3D"),
    ("payload_inertia", "VECTOR6D"),
];

/// Measured values at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Instant {
    /// Time since the controller's start \[s\].
    pub timestamp_s: f64,
    pub position: [f64; 6],
    pub velocity: [f64; 6],
    pub effort: [f64; 6],
    pub target_moment: [f64; 6],
    pub payload_kg: f64,
}

/// Settings of the simulated controller.
#[derive(Debug, Clone)]
pub struct Behaviour {
    /// Accepted version of the protocol.
    pub version: u16,
    /// Missing outputs.
    pub without: Vec<&'static str>,
    /// Bytes per piece in which packages are sent.
    pub piece: usize,
    /// Whether data follows.
    pub sends: bool,
    /// Number of instants after which it closes a connection.
    pub closes_after: Option<usize>,
    /// Pause between instants.
    pub pause: Duration,
    /// Fixed reply instead of any answer.
    pub says: Option<&'static [u8]>,
}

impl Default for Behaviour {
    fn default() -> Self {
        Self {
            version: 2,
            without: Vec::new(),
            piece: usize::MAX,
            sends: true,
            closes_after: None,
            pause: Duration::from_millis(1),
            says: None,
        }
    }
}

/// A controller that listens until it is dropped. All connections share one stream of instants.
pub struct Controller {
    pub port: u16,
    stop: Arc<AtomicBool>,
    next: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl Controller {
    /// Starts it on a free port.
    pub fn start(behaviour: Behaviour, instants: Vec<Instant>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        Self::start_on(listener, behaviour, instants)
    }

    pub fn start_on(listener: TcpListener, behaviour: Behaviour, instants: Vec<Instant>) -> Self {
        let port = listener.local_addr().unwrap().port();
        let stop = Arc::new(AtomicBool::new(false));
        let next = Arc::new(AtomicUsize::new(0));
        listener.set_nonblocking(true).unwrap();
        let (ours, place) = (Arc::clone(&stop), Arc::clone(&next));
        let thread = std::thread::spawn(move || {
            while !ours.load(Ordering::Relaxed) {
                if let Ok((stream, _)) = listener.accept() {
                    stream.set_nonblocking(false).unwrap();
                    // A client that disconnects ends its connection.
                    let _ = serve(&stream, &behaviour, &instants, &place, &ours);
                }
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        Self {
            port,
            stop,
            next,
            thread: Some(thread),
        }
    }

    /// Number of instants sent.
    pub fn sent(&self) -> usize {
        self.next.load(Ordering::Relaxed)
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

fn serve(
    mut stream: &TcpStream,
    behaviour: &Behaviour,
    instants: &[Instant],
    next: &AtomicUsize,
    stop: &AtomicBool,
) -> std::io::Result<()> {
    stream.set_read_timeout(Some(Duration::from_secs(10)))?;
    if let Some(bytes) = behaviour.says {
        stream.write_all(bytes)?;
    }
    let mut names = Vec::new();
    loop {
        let mut header = [0; 3];
        stream.read_exact(&mut header)?;
        let len = usize::from(u16::from_be_bytes([header[0], header[1]]));
        let mut body = vec![0; len - 3];
        stream.read_exact(&mut body)?;
        if behaviour.says.is_some() {
            continue;
        }
        let answer = match header[2] {
            b'V' => vec![u8::from(body == behaviour.version.to_be_bytes())],
            b'v' => [5_u32, 25, 1, 0].map(u32::to_be_bytes).concat(),
            b'O' => {
                let text = String::from_utf8(body[8..].to_vec()).unwrap();
                names = text.split(',').map(str::to_owned).collect::<Vec<_>>();
                let of = |name: &String| {
                    let has = |(output, _): &&(&str, &str)| {
                        output == name && !behaviour.without.contains(output)
                    };
                    OUTPUTS
                        .iter()
                        .find(has)
                        .map_or("NOT_FOUND", |found| found.1)
                };
                let types: Vec<&str> = names.iter().map(of).collect();
                let id = u8::from(!types.contains(&"NOT_FOUND"));
                [&[id], types.join(",").as_bytes()].concat()
            }
            b'S' => vec![1],
            letter => panic!("a request {letter}"),
        };
        send(stream, behaviour, header[2], &answer)?;
        if header[2] == b'S' {
            break;
        }
    }
    // Like real controllers, it sends a text message in between.
    send(stream, behaviour, b'M', b"\x05hello\x04test\x03")?;
    if !behaviour.sends {
        std::thread::sleep(Duration::from_secs(3));
        return Ok(());
    }
    for sent in 0.. {
        let at = next.load(Ordering::Relaxed);
        let over = behaviour.closes_after.is_some_and(|limit| sent >= limit);
        if stop.load(Ordering::Relaxed) || over {
            return Ok(());
        }
        let Some(instant) = instants.get(at) else {
            std::thread::sleep(Duration::from_millis(10));
            continue;
        };
        next.store(at + 1, Ordering::Relaxed);
        send(stream, behaviour, b'U', &data(&names, instant))?;
        std::thread::sleep(behaviour.pause);
    }
    Ok(())
}

fn data(names: &[String], instant: &Instant) -> Vec<u8> {
    let mut body = vec![1];
    for name in names {
        let numbers: &[f64] = match name.as_str() {
            "timestamp" => &[instant.timestamp_s],
            "actual_q" => &instant.position,
            "actual_qd" => &instant.velocity,
            "target_moment" => &instant.target_moment,
            "payload" => &[instant.payload_kg],
            "payload_cog" => &[0.01, 0.02, 0.03],
            "payload_inertia" => &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            _ => &instant.effort,
        };
        for number in numbers {
            body.extend_from_slice(&number.to_be_bytes());
        }
    }
    body
}

fn send(
    mut stream: &TcpStream,
    behaviour: &Behaviour,
    letter: u8,
    body: &[u8],
) -> std::io::Result<()> {
    let len = u16::try_from(body.len() + 3).unwrap().to_be_bytes();
    let bytes = [&len, &[letter][..], body].concat();
    for piece in bytes.chunks(behaviour.piece.max(1)) {
        stream.write_all(piece)?;
        if piece.len() < bytes.len() {
            stream.flush()?;
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    Ok(())
}
