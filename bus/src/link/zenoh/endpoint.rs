//! Endpoints: what is one, and why one cannot be reached.

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use zenoh::Wait as _;

use super::{config, zenoh_reason};

/// The transports that are built in.
const TRANSPORTS: [&str; 2] = ["tcp", "tls"];
/// A session that has met nobody after this time has a reason.
/// Resolution: how soon a wrong endpoint is named, against peers that are still starting.
const MEETS_WITHIN: Duration = Duration::from_secs(4);
/// And after this one it is said again.
const AGAIN_AFTER: Duration = Duration::from_mins(5);
/// How often it is looked.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// How long an endpoint may take to answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// Why a text is no endpoint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EndpointError {
    /// It does not begin with a transport.
    #[error("`{0}` is no endpoint: it has the form `tcp/HOST:PORT`")]
    Form(String),
    /// The transport is not built in.
    #[error("`{endpoint}`: there is no transport `{transport}`, only {}", TRANSPORTS.join(" and "))]
    Transport {
        /// The endpoint.
        endpoint: String,
        /// What it begins with.
        transport: String,
    },
    /// It names no host or no port.
    #[error("`{0}` names no host and port: it has the form `tcp/HOST:PORT`")]
    Address(String),
}

/// Whether Zenoh could use it: `tcp/HOST:PORT` or `tls/HOST:PORT#SETTINGS`. Nobody need be there.
///
/// # Errors
/// Why not.
pub fn check_endpoint(endpoint: &str) -> Result<(), EndpointError> {
    let Some((transport, _)) = endpoint.split_once('/') else {
        return Err(EndpointError::Form(endpoint.to_owned()));
    };
    if !TRANSPORTS.contains(&transport) {
        return Err(EndpointError::Transport {
            endpoint: endpoint.to_owned(),
            transport: transport.to_owned(),
        });
    }
    let parts = address(endpoint).and_then(|address| address.rsplit_once(':'));
    let is_address = parts.is_some_and(|(host, port)| {
        let bare = host.starts_with('[') && host.ends_with(']') || !host.contains([':', ' ']);
        !host.is_empty() && bare && port.parse::<u16>().is_ok()
    });
    if is_address && endpoint.parse::<zenoh::config::EndPoint>().is_ok() {
        Ok(())
    } else {
        Err(EndpointError::Address(endpoint.to_owned()))
    }
}

/// Host and port of an endpoint.
fn address(endpoint: &str) -> Option<&str> {
    let (_, rest) = endpoint.split_once('/')?;
    let end = rest.find(['?', '#']).unwrap_or(rest.len());
    Some(&rest[..end])
}

/// Says why a session meets nobody where it should, until it has met somebody.
pub(super) fn watch(session: &zenoh::Session, connect: &[String]) {
    if connect.is_empty() {
        return;
    }
    let (info, connect) = (session.info(), connect.to_vec());
    // Where there is no thread, a wrong endpoint is silent and all else works.
    let _ = std::thread::Builder::new()
        .name("zenoh endpoints".to_owned())
        .spawn(move || {
            let mut due = Instant::now() + MEETS_WITHIN;
            while !meets(&info) {
                if Instant::now() >= due {
                    for endpoint in &connect {
                        let reason = why_unreached(endpoint);
                        // Where its keys lie is nobody's business.
                        let plain = endpoint.split('#').next().unwrap_or_default();
                        tracing::error!("no session with {plain}: {reason}; it is tried on");
                    }
                    due = Instant::now() + AGAIN_AFTER;
                }
                std::thread::sleep(LOOK_EVERY);
            }
        });
}

/// Whether the session has a peer or a router.
fn meets(info: &zenoh::session::SessionInfo) -> bool {
    info.routers_zid().wait().count() + info.peers_zid().wait().count() > 0
}

fn why_unreached(endpoint: &str) -> String {
    if let Some(Err(error)) = address(endpoint).map(answers) {
        return format!("nobody answers there ({error})");
    }
    // It answers: what it says to a session of its own.
    let timeout = ANSWER_WITHIN.as_millis().to_string();
    let settings = [
        ("connect/timeout_ms", timeout),
        ("connect/exit_on_failure", "true".to_owned()),
    ];
    let here = super::ZenohEndpoints {
        listen: Vec::new(),
        connect: vec![endpoint.to_owned()],
    };
    let opened = config("client", &here, super::PATIENCE, &settings)
        .and_then(|config| zenoh::open(config).wait());
    match opened {
        Ok(_) => "it answers now".to_owned(),
        Err(error) => format!(
            "it answers and lets no session open; a refused certificate, or TLS at one end only ({})",
            zenoh_reason(&error)
        ),
    }
}

fn answers(address: &str) -> io::Result<()> {
    let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, ANSWER_WITHIN) {
            Ok(_) => return Ok(()),
            Err(error) => last = error,
        }
    }
    Err(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_zenoh_can_use_is_an_endpoint() {
        for endpoint in [
            "tcp/127.0.0.1:7447",
            "tcp/[::1]:7447",
            "tls/cell-1.plant:7448#root_ca_certificate_file=ca.pem",
            "tcp/0.0.0.0:0",
        ] {
            assert_eq!(check_endpoint(endpoint), Ok(()));
        }
    }

    #[test]
    fn what_it_cannot_use_is_none_and_says_why() {
        for (endpoint, why) in [
            ("garbage", "has the form"),
            ("", "has the form"),
            ("10.0.0.1:7447", "has the form"),
            ("udp/10.0.0.1:7447", "no transport `udp`"),
            ("tcp/10.0.0.1", "host and port"),
            ("tcp/:7447", "host and port"),
            ("tcp/host:port", "host and port"),
            ("tcp/host:70000", "host and port"),
            ("tcp/::1:7447", "host and port"),
        ] {
            let error = check_endpoint(endpoint).unwrap_err().to_string();
            assert!(error.contains(why), "{endpoint}: {error}");
        }
    }
}
