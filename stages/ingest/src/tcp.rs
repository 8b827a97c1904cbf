//! Connections over TCP, and why there is none.

use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Why an address cannot be reached.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreachable {
    /// The name cannot be looked up.
    #[error("its name is not known: {0}")]
    Name(String),
    /// The name stands for nothing.
    #[error("its name has no address")]
    NoAddress,
    /// The host is there, and nobody listens on the port.
    #[error("connection refused")]
    Refused,
    /// Nothing came back in time.
    #[error("no answer")]
    NoAnswer,
    /// Something else.
    #[error("{0}")]
    Other(String),
}

/// Connects to `host:port`, and gives each of its addresses this long to answer.
///
/// # Errors
/// Why the last address could not be reached.
pub(crate) fn connect(address: &str, within: Duration) -> Result<TcpStream, Unreachable> {
    let addresses = address
        .to_socket_addrs()
        .map_err(|error| Unreachable::Name(error.to_string()))?;
    let mut fault = Unreachable::NoAddress;
    for address in addresses {
        match TcpStream::connect_timeout(&address, within) {
            Ok(stream) => return Ok(stream),
            Err(error) => {
                fault = match error.kind() {
                    ErrorKind::ConnectionRefused => Unreachable::Refused,
                    ErrorKind::TimedOut => Unreachable::NoAnswer,
                    _ => Unreachable::Other(error.to_string()),
                };
            }
        }
    }
    Err(fault)
}
