//! Checks of a client's requests before tokio-modbus decodes them.
//!
//! A request to write several coils (function 15) may announce more coils than it has bytes for. tokio-modbus 0.17
//! then indexes past its end, and the panic ends the client's task. The guard closes the connection with an error
//! instead.
//!
//! A client whose cable was unplugged does not disconnect. The guard also disconnects a client that is silent for
//! long.

use std::future::Future as _;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};

/// Bytes before a request: transaction, protocol and length (MODBUS Messaging on TCP/IP 1.0b, section 3.1.3).
const BEFORE: usize = 6;
/// Bytes before the coils: unit, function, address, number of coils and number of bytes follow [`BEFORE`].
const HEAD: usize = BEFORE + 7;
const WRITE_SEVERAL_COILS: u8 = 15;

/// Guarded stream of a client.
pub(super) struct Guard<S> {
    stream: S,
    requests: Requests,
    from: SocketAddr,
    /// Timeout of a silent client.
    idle: Duration,
    /// Expiry of the timeout.
    end: Pin<Box<Sleep>>,
}

/// Parsing state of the requests.
#[derive(Default)]
struct Requests {
    head: [u8; HEAD],
    /// Number of bytes of the current request so far.
    at: usize,
}

impl Requests {
    fn take(&mut self, bytes: &[u8]) -> io::Result<()> {
        bytes.iter().try_for_each(|byte| self.step(*byte))
    }

    fn step(&mut self, byte: u8) -> io::Result<()> {
        if let Some(place) = self.head.get_mut(self.at) {
            *place = byte;
        }
        self.at += 1;
        let number =
            |at: usize| usize::from(u16::from_be_bytes([self.head[at], self.head[at + 1]]));
        if self.at == HEAD && self.head[BEFORE + 1] == WRITE_SEVERAL_COILS {
            let (coils, bytes) = (number(BEFORE + 4), usize::from(self.head[HEAD - 1]));
            if coils > 8 * bytes {
                let why = format!("it writes {coils} coils and has {bytes} bytes of them");
                return Err(io::Error::new(io::ErrorKind::InvalidData, why));
            }
        }
        if self.at >= BEFORE && self.at == BEFORE + number(BEFORE - 2) {
            self.at = 0;
        }
        Ok(())
    }
}

impl<S> Guard<S> {
    /// Guards the stream of the client `from`, with the timeout `idle`.
    pub(super) fn new(stream: S, from: SocketAddr, idle: Duration) -> Self {
        Self {
            stream,
            requests: Requests::default(),
            from,
            idle,
            end: Box::pin(tokio::time::sleep(idle)),
        }
    }

    /// Restarts the timeout, after the client has sent bytes or received an answer.
    fn moves(&mut self) {
        // An expiry beyond the range of the clock means no timeout.
        if let Some(end) = Instant::now().checked_add(self.idle) {
            self.end.as_mut().reset(end);
        }
    }

    /// Is ready once the client has been silent for too long.
    fn poll_silence(&mut self, context: &mut Context<'_>) -> Poll<io::Error> {
        ready!(self.end.as_mut().poll(context));
        let (from, idle_s) = (self.from, self.idle.as_secs_f64());
        tracing::warn!(
            "Modbus client {from} is disconnected: it has said nothing for {idle_s} s (`idle_s`)"
        );
        Poll::Ready(io::ErrorKind::TimedOut.into())
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Guard<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let Poll::Ready(read) = Pin::new(&mut self.stream).poll_read(context, buffer) else {
            return self.poll_silence(context).map(Err);
        };
        read?;
        self.moves();
        Poll::Ready(self.requests.take(&buffer.filled()[before..]))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Guard<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let Poll::Ready(written) = Pin::new(&mut self.stream).poll_write(context, bytes) else {
            return self.poll_silence(context).map(Err);
        };
        self.moves();
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A request to read one coil.
    const SOUND: [u8; 12] = [0, 7, 0, 0, 0, 6, 1, 1, 0, 0, 0, 1];
    /// Returns a request to write `coils` coils from one byte.
    const fn writes(coils: u8) -> [u8; 14] {
        [0, 7, 0, 0, 0, 8, 1, 15, 0, 0, 0, coils, 1, 0xff]
    }

    #[test]
    fn more_coils_than_there_are_end_a_client_however_its_bytes_come() {
        for pieces in [1, 3, 5, 64] {
            let mut requests = Requests::default();
            let sound = [&SOUND[..], &writes(8), &SOUND].concat();
            for piece in sound.chunks(pieces) {
                requests.take(piece).unwrap();
            }
            let told: Result<(), _> = writes(9)
                .chunks(pieces)
                .try_for_each(|piece| requests.take(piece));
            let said = told.unwrap_err().to_string();
            assert_eq!(said, "it writes 9 coils and has 1 bytes of them");
        }
    }
}
