//! Endpoints: syntax check, and diagnosis of unreachable ones.

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use zenoh::Wait as _;

use super::{config, zenoh_reason};

/// Built-in transports.
const TRANSPORTS: [&str; 2] = ["tcp", "tls"];
/// Time after which a session without a peer is diagnosed.
/// Resolution: delay of the report of a wrong endpoint, against peers that are still starting.
const MEETS_WITHIN: Duration = Duration::from_secs(4);
/// Interval at which the report is repeated.
const AGAIN_AFTER: Duration = Duration::from_mins(5);
/// Polling interval for the first peer.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Timeout of a connection attempt during the diagnosis.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);

/// Reason why a text is not an endpoint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EndpointError {
    /// Missing transport.
    #[error("`{0}` is no endpoint: it has the form `tcp/HOST:PORT`")]
    Form(String),
    /// Transport that is not built in.
    #[error("`{endpoint}`: there is no transport `{transport}`, only {}", TRANSPORTS.join(" and "))]
    Transport {
        /// The endpoint.
        endpoint: String,
        /// Transport of the endpoint.
        transport: String,
    },
    /// Missing or malformed host or port.
    #[error("`{0}` names no host and port: it has the form `tcp/HOST:PORT`")]
    Address(String),
}

/// Checks the syntax of an endpoint: `tcp/HOST:PORT` or `tls/HOST:PORT#SETTINGS`. It need not be reachable.
///
/// # Errors
/// If Zenoh cannot use the endpoint.
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

/// Reports why a session has no peer, until it has one.
pub(super) fn watch(session: &zenoh::Session, connect: &[String]) {
    if connect.is_empty() {
        return;
    }
    let (info, connect) = (session.info(), connect.to_vec());
    // Without this thread a wrong endpoint is not reported, but all else works.
    let _ = std::thread::Builder::new()
        .name("zenoh endpoints".to_owned())
        .spawn(move || {
            let mut due = Instant::now() + MEETS_WITHIN;
            while !meets(&info) {
                if Instant::now() >= due {
                    for endpoint in &connect {
                        let reason = why_unreached(endpoint);
                        // The settings after `#` may have paths of private keys.
                        let plain = endpoint.split('#').next().unwrap_or_default();
                        tracing::error!("no session with {plain}: {reason}; retrying");
                    }
                    due = Instant::now() + AGAIN_AFTER;
                }
                std::thread::sleep(LOOK_EVERY);
            }
        });
}

/// Whether the session is connected to a peer or a router.
fn meets(info: &zenoh::session::SessionInfo) -> bool {
    info.routers_zid().wait().count() + info.peers_zid().wait().count() > 0
}

fn why_unreached(endpoint: &str) -> String {
    if let Some(Err(error)) = address(endpoint).map(answers) {
        return format!("no answer there ({error})");
    }
    // The port answers: a separate session gives the error of Zenoh.
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
