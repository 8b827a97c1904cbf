//! A Modbus TCP server for a PLC. Not a safety function.
//!
//! What is read is worked out when it is read: the age of the newest sample counts, so a pipeline that hangs reads as
//! stop, and one that is dead breaks the connection.

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

/// Clients at a time; a further one is turned away.
const MAX_CLIENTS: usize = 8;
/// How long a write waits for the pipeline's answer: longer than a command waits for a sample, so that none holds after it
/// was said to have failed.
const PATIENCE: Duration = Duration::from_secs(2);
/// A listener that failed is tried again after so long.
const AGAIN_AFTER: Duration = Duration::from_millis(100);

/// What the server shows, newest wins. Clones are one.
#[derive(Debug, Clone)]
pub struct Board(Arc<Mutex<Status>>);

impl Board {
    /// Shows `status` first.
    pub fn new(status: Status) -> Self {
        Self(Arc::new(Mutex::new(status)))
    }

    /// Shows `status` from now on.
    pub fn show(&self, status: &Status) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone_from(status);
    }

    /// What it shows.
    pub fn read(&self) -> Status {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// How commands reach the pipeline.
#[derive(Debug, Clone)]
pub struct Commands {
    /// Connected to where the cell's source takes commands.
    pub session: zenoh::Session,
    /// The cell.
    pub cell: String,
}

/// A server that runs as long as this lives.
pub struct Modbus {
    address: SocketAddr,
    runtime: Option<Runtime>,
}

/// A command that waits for its answer is not waited for.
impl Drop for Modbus {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

impl Modbus {
    /// Listens where `config` says and shows what is on `board`. Writes are commands.
    ///
    /// # Errors
    /// If it cannot listen there.
    pub fn serve(
        config: &ModbusConfig,
        board: &Board,
        commands: Option<Commands>,
    ) -> Result<Self, PublishError> {
        let address = config.listen;
        // The schema bounds it; a program that gives nonsense gets a client that may be silent for ever.
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
                // Answers are small and must not wait for more; where that cannot be, they do.
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

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

/// What one client is served with.
struct Client {
    board: Board,
    commands: Option<Commands>,
    /// Its place among the clients, free again when it leaves.
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
    /// Asks the pipeline for what is written; `done` is the reply once it holds.
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
