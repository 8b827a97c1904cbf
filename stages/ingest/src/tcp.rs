//! TCP connections, and the reasons for their failure.

use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Reasons why an address cannot be reached.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreachable {
    /// A name that cannot be resolved.
    #[error("its name is not known: {0}")]
    Name(String),
    /// A name without an address.
    #[error("its name has no address")]
    NoAddress,
    /// A reachable host without a listener on the port.
    #[error("connection refused")]
    Refused,
    /// A timeout.
    #[error("no answer")]
    NoAnswer,
    /// Another error.
    #[error("{0}")]
    Other(String),
}

/// Connects to `host:port`, with the timeout `within` for each of its addresses.
///
/// # Errors
/// The reason why the last address could not be reached.
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
