//! A Modbus TCP server for a PLC. Not a safety function.
//!
//! Values are computed when they are read, from the age of the newest sample: a hung pipeline reads as stop, and a
//! dead one closes the connection.

mod guard;
pub mod registers;

use std::future::Future;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tauscope_bus::command::{Answer, Request as Asked, ask};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::Server;
use tokio_modbus::{ExceptionCode, Request, Response};

use crate::config::ModbusConfig;
use crate::error::PublishError;
use crate::status::Status;
use guard::Guard;
use registers::{Registers, Write};

/// Maximum number of clients; further ones are rejected.
const MAX_CLIENTS: usize = 8;
/// Timeout of a write for the pipeline's answer. It is longer than a command waits for a sample, so that no command
/// takes effect after its write was reported as failed.
const PATIENCE: Duration = Duration::from_secs(2);
/// Pause before a failed listener is retried.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// The newest status, which the server reads. Clones share it.
#[derive(Debug, Clone)]
pub struct Board(Arc<Mutex<Status>>);

impl Board {
    /// Creates a board with a first status.
    pub fn new(status: Status) -> Self {
        Self(Arc::new(Mutex::new(status)))
    }

    /// Replaces the status.
    pub fn show(&self, status: &Status) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone_from(status);
    }

    /// Returns the status.
    pub fn read(&self) -> Status {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// Connection over which commands reach the pipeline.
#[derive(Debug, Clone)]
pub struct Commands {
    /// Session that is connected to the command endpoints of the cell's source.
    pub session: zenoh::Session,
    /// Name of the cell.
    pub cell: String,
}

/// A server that runs until it is dropped.
pub struct Modbus {
    address: SocketAddr,
    runtime: Option<Runtime>,
}

/// Does not wait for commands without an answer.
impl Drop for Modbus {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

impl Modbus {
    /// Listens at the address in `config` and serves the status on `board`. Writes become commands.
    ///
    /// # Errors
    /// If it cannot listen there.
    pub fn serve(
        config: &ModbusConfig,
        board: &Board,
        commands: Option<Commands>,
    ) -> Result<Self, PublishError> {
        let address = config.listen;
        // The schema bounds it; an invalid value from a program disables the timeout.
        let idle = Duration::try_from_secs_f64(config.idle_s).unwrap_or(Duration::MAX);
        let failed = |source| PublishError::Modbus { address, source };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("modbus")
            .enable_all()
            .build()
            .map_err(failed)?;
        let listener = std::net::TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let listener = {
            let _entered = runtime.enter();
            TcpListener::from_std(listener).map_err(failed)?
        };
        let (board, room) = (board.clone(), Arc::new(Semaphore::new(MAX_CLIENTS)));
        runtime.spawn(async move {
            let connected = |stream: tokio::net::TcpStream, from: SocketAddr| {
                let client = room.clone().try_acquire_owned().ok().map(|permit| Client {
                    board: board.clone(),
                    commands: commands.clone(),
                    _permit: permit,
                });
                if client.is_none() {
                    tracing::warn!(
                        "Modbus client {from} is turned away: {MAX_CLIENTS} are served already"
                    );
                }
                // Answers are small: Nagle's algorithm would delay them. A failure here only costs time.
                let _ = stream.set_nodelay(true);
                async move { Ok(client.map(|client| (client, Guard::new(stream, from, idle)))) }
            };
            let server = Server::new(listener);
            loop {
                let gone =
                    |error: std::io::Error| tracing::debug!("a Modbus client is gone: {error}");
                if let Err(error) = server.serve(&connected, gone).await {
                    tracing::warn!("Modbus at {address}: {error}");
                    tokio::time::sleep(AGAIN_AFTER).await;
                }
            }
        });
        Ok(Self {
            address,
            runtime: Some(runtime),
        })
    }

    /// Returns the address that it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

/// Service of one client.
struct Client {
    board: Board,
    commands: Option<Commands>,
    /// Slot of the client, released when it disconnects.
    _permit: OwnedSemaphorePermit,
}

type Reply = Pin<Box<dyn Future<Output = Result<Response, ExceptionCode>> + Send>>;

impl Service for Client {
    type Request = Request<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Reply;

    fn call(&self, request: Request<'static>) -> Reply {
        let registers = Registers::of(&self.board.read(), std::time::Instant::now());
        let answer = match request {
            Request::ReadCoils(at, count) => registers.bits(at, count).map(Response::ReadCoils),
            Request::ReadDiscreteInputs(at, count) => {
                registers.bits(at, count).map(Response::ReadDiscreteInputs)
            }
            Request::ReadInputRegisters(at, count) => {
                registers.words(at, count).map(Response::ReadInputRegisters)
            }
            Request::ReadHoldingRegisters(at, count) => registers
                .words(at, count)
                .map(Response::ReadHoldingRegisters),
            Request::WriteSingleCoil(at, value) => {
                let write = registers::coil(at, value);
                return self.write(write, Response::WriteSingleCoil(at, value));
            }
            Request::WriteMultipleCoils(at, values) => {
                let write = match values.as_ref() {
                    [value] => registers::coil(at, *value),
                    _ => Err(ExceptionCode::IllegalDataAddress),
                };
                return self.write(write, Response::WriteMultipleCoils(at, 1));
            }
            Request::WriteSingleRegister(at, value) => {
                let write = registers::words(at, &[value]);
                return self.write(write, Response::WriteSingleRegister(at, value));
            }
            Request::WriteMultipleRegisters(at, values) => {
                let count = values.len() as u16;
                let write = registers::words(at, &values);
                return self.write(write, Response::WriteMultipleRegisters(at, count));
            }
            _ => Err(ExceptionCode::IllegalFunction),
        };
        Box::pin(std::future::ready(answer))
    }
}

impl Client {
    /// Sends the written command to the pipeline; `done` is the reply once it is accepted.
    fn write(&self, write: Result<Write, ExceptionCode>, done: Response) -> Reply {
        let commands = self.commands.clone();
        Box::pin(async move {
            let asked = match write? {
                Write::Nothing => return Ok(done),
                Write::Acknowledge => Asked::Acknowledge,
                Write::Mute { seconds } => Asked::Mute { seconds },
                Write::Payload { mass_kg, com_m } => Asked::Payload { mass_kg, com_m },
                Write::Learn => Asked::Learn,
                Write::Label(number) => Asked::Label {
                    text: format!("plc {number}"),
                },
            };
            let commands = commands.ok_or(ExceptionCode::ServerDeviceFailure)?;
            let answer = tokio::task::spawn_blocking(move || {
                ask(&commands.session, &commands.cell, &asked, PATIENCE)
            });
            match answer.await {
                Ok(Ok(Answer::Taken { .. })) => Ok(done),
                Ok(Ok(Answer::Refused { reason })) => {
                    tracing::warn!("a command by Modbus was refused: {reason}");
                    Err(ExceptionCode::IllegalDataValue)
                }
                Ok(Err(error)) => {
                    tracing::warn!("a command by Modbus failed: {error}");
                    Err(ExceptionCode::ServerDeviceFailure)
                }
                Err(_) => Err(ExceptionCode::ServerDeviceFailure),
            }
        })
    }
}
