//! Endpoints as Zenoh writes them: `tls/10.0.0.1:7447#root_ca_certificate=ca.pem;...`.

use std::io;
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;

/// Timeout of a connection.
/// Resolution: acceptable duration of the command.
const PATIENCE: Duration = Duration::from_secs(2);

/// Returns host and port of an endpoint, if its transport has them.
pub(super) fn address(endpoint: &str) -> Option<&str> {
    let (transport, rest) = endpoint.split_once('/')?;
    let over_tcp = matches!(transport, "tcp" | "tls" | "ws");
    let end = rest.find(['?', '#']).unwrap_or(rest.len());
    over_tcp.then_some(&rest[..end])
}

/// Returns the certificates in an endpoint's settings.
pub(super) fn certificates(endpoint: &str) -> Vec<PathBuf> {
    files(endpoint, "certificate")
}

/// Returns the private keys in an endpoint's settings.
pub(super) fn private_keys(endpoint: &str) -> Vec<PathBuf> {
    files(endpoint, "private_key")
}

/// Returns the paths in the settings whose names end in `kind`, with or without `_file`.
fn files(endpoint: &str, kind: &str) -> Vec<PathBuf> {
    let settings = endpoint
        .split_once('#')
        .map_or("", |(_, settings)| settings);
    let pairs = settings.split(';').filter_map(|pair| pair.split_once('='));
    let files = pairs.filter(|(key, _)| key.strip_suffix("_file").unwrap_or(key).ends_with(kind));
    files.map(|(_, path)| PathBuf::from(path)).collect()
}

/// Checks that an address can be listened on.
pub(super) fn is_free(address: &str) -> io::Result<()> {
    TcpListener::bind(address).map(drop)
}

/// Checks that a connection to an address is accepted.
pub(super) fn answers(address: &str) -> io::Result<()> {
    let mut last = io::Error::from(io::ErrorKind::AddrNotAvailable);
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
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
    fn an_endpoint_names_an_address_and_certificates() {
        // A key without `_file` is for an inline certificate; a path under either key is checked.
        let endpoint = "tls/cell:7447?prio=1#root_ca_certificate_file=ca.pem;connect_private_key_file=k.pem;\
                        connect_certificate=own.pem";
        assert_eq!(address(endpoint), Some("cell:7447"));
        assert_eq!(
            certificates(endpoint),
            ["ca.pem", "own.pem"].map(PathBuf::from)
        );
        assert_eq!(private_keys(endpoint), [PathBuf::from("k.pem")]);
        assert_eq!(address("unixsock-stream//tmp/a"), None);
        assert!(certificates("tcp/127.0.0.1:7447").is_empty());
    }

    #[test]
    fn a_port_is_free_until_somebody_listens_on_it() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        assert!(is_free(&address).is_err());
        answers(&address).unwrap();
        drop(listener);
        is_free(&address).unwrap();
        assert!(answers(&address).is_err());
    }
}
