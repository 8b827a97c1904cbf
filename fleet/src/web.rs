//! The page: the wall, a page for each cell, incidents, metrics. Plain HTTP, no framework, nothing from elsewhere.
//!
//! Anyone who reaches the address can read. Only users with a token can act; their actions are sent to the cell as
//! the commands of `tauscope send`.

mod actions;
mod events;
mod headers;
mod metrics;
mod pages;
mod sessions;
mod users;

use std::net::SocketAddr;
use std::sync::Arc;
use std::thread::JoinHandle;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware;
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use tokio::sync::{Semaphore, oneshot};

use headers::Door;
pub use headers::{NoOrigin, Origin};
pub use users::{NewUser, Users, UsersError};

use crate::hub::Hub;
use crate::physics::CellPhysics;
use crate::store::Note;
use sessions::Sessions;

/// Maximum size of a form \[bytes\].
const MAX_BODY_BYTES: usize = 4096;
/// Maximum number of notes shown.
const MOST_NOTES: u32 = 50;
/// Maximum number of pages that follow the wall at a time. Resolution: every screen of a plant, and some.
const MAX_FOLLOWERS: usize = 64;

/// An error of serving the page.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// An address that cannot be bound.
    #[error("cannot serve the page at {address}: {source}; is the port taken, or below 1024?")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A thread or a runtime that cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// State shared by all handlers.
struct Shared {
    hub: Arc<Hub>,
    users: Users,
    sessions: Sessions,
    followers: Arc<Semaphore>,
    door: Door,
}

type App = State<Arc<Shared>>;

/// A server of the page that runs until it is dropped.
pub struct Server {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves the wall of `hub` at `address`, and through proxies as `origins`. Without `users` the page is
    /// read-only.
    ///
    /// # Errors
    /// If the address cannot be bound.
    pub fn start(
        hub: Arc<Hub>,
        address: SocketAddr,
        users: Users,
        origins: Vec<Origin>,
    ) -> Result<Self, ServeError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("fleet-page")
            .enable_all()
            .build()?;
        let listener = runtime.block_on(tokio::net::TcpListener::bind(address));
        let listening = listener.and_then(|listener| Ok((listener.local_addr()?, listener)));
        let (address, listener) =
            listening.map_err(|source| ServeError::Listen { address, source })?;
        let shared = Arc::new(Shared {
            hub,
            users,
            sessions: Sessions::default(),
            followers: Arc::new(Semaphore::new(MAX_FOLLOWERS)),
            door: Door {
                is_loopback: address.ip().is_loopback(),
                origins,
            },
        });
        let (stop, stopped) = oneshot::channel::<()>();
        let thread = std::thread::Builder::new().name("fleet-page".to_owned());
        let thread = thread.spawn(move || {
            runtime.block_on(async {
                let served = axum::serve(listener, router(shared));
                tokio::select! {
                    served = served => if let Err(error) = served {
                        tracing::warn!("the page is no longer served: {error}");
                    },
                    // Pages that follow the wall would never end by themselves.
                    _ = stopped => {}
                }
            });
            runtime.shutdown_background();
        })?;
        Ok(Self {
            address,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Returns the address at which it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            // It may have ended by itself.
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            // A panic has already been reported.
            let _ = thread.join();
        }
    }
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(wall))
        .route("/cells/{cell}", get(cell))
        .route("/cells/{cell}/week", get(week))
        .route("/cells/{cell}/week.json", get(week_json))
        .route("/incidents", get(incidents))
        .route("/events", get(events::all))
        .route("/cells/{cell}/events", get(events::one))
        .route("/fleet.json", get(json))
        .route("/metrics", get(metrics::metrics))
        .route("/healthz", get(healthz))
        .route("/style.css", get(style))
        .route("/wall.js", get(script))
        .route("/login", get(login).post(actions::login))
        .route("/logout", post(actions::logout))
        .route("/cells/{cell}/acknowledge", post(actions::acknowledge))
        .route("/cells/{cell}/mute", post(actions::mute))
        .route("/cells/{cell}/label", post(actions::label))
        .route("/cells/{cell}/note", post(actions::note))
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .layer(middleware::from_fn_with_state(
            shared.clone(),
            headers::guard,
        ))
        .with_state(shared)
}

/// Renders a page for the user of the request, or for a visitor who is not logged in.
fn page(
    shared: &Shared,
    headers: &HeaderMap,
    body: impl FnOnce(&pages::Viewer) -> maud::Markup,
) -> Response {
    let session = shared.sessions.of(headers);
    let viewer = pages::Viewer {
        user: session.as_ref().map(|session| session.user.clone()),
        csrf: session.as_ref().map(|session| session.csrf.clone()),
        told: session.and_then(|session| session.told),
        has_users: !shared.users.is_empty(),
    };
    Html(body(&viewer).into_string()).into_response()
}

async fn wall(State(shared): App, headers: HeaderMap) -> Response {
    let snapshot = shared.hub.snapshot();
    page(&shared, &headers, |viewer| {
        pages::wall::page(viewer, &snapshot)
    })
}

async fn cell(State(shared): App, Path(name): Path<String>, headers: HeaderMap) -> Response {
    let reading = shared.clone();
    let asked = name.clone();
    let read = tokio::task::spawn_blocking(move || {
        let snapshot = reading.hub.snapshot();
        snapshot.cell(&asked)?;
        let kept = pages::cell::Kept::read(&reading.hub, &asked, snapshot.now_ns);
        Some((snapshot, kept))
    });
    let Ok(Some((snapshot, kept))) = read.await else {
        let text = format!("there is no cell `{name}` here");
        let body = page(&shared, &headers, |viewer| pages::not_found(viewer, &text));
        return (StatusCode::NOT_FOUND, body).into_response();
    };
    page(&shared, &headers, |viewer| {
        pages::cell::page(viewer, &snapshot, &name, &kept)
    })
}

/// The page of a cell's week.
async fn week(State(shared): App, Path(name): Path<String>, headers: HeaderMap) -> Response {
    let reading = shared.clone();
    let asked = name.clone();
    let read = tokio::task::spawn_blocking(move || {
        let physics = reading.hub.physics(&asked)?;
        let notes = reading.hub.kept(|store| store.notes(&asked, MOST_NOTES));
        Some((physics, notes.and_then(Result::ok).unwrap_or_default()))
    });
    let Ok(Some((physics, notes))) = read.await else {
        return no_physics(&shared, &headers, &name);
    };
    let now_ns = shared.hub.snapshot().now_ns;
    Html(pages::physics::week(&physics, &notes, now_ns, None).into_string()).into_response()
}

async fn week_json(State(shared): App, Path(name): Path<String>, headers: HeaderMap) -> Response {
    match shared.hub.physics(&name) {
        Some(physics) => axum::Json(physics).into_response(),
        None => no_physics(&shared, &headers, &name),
    }
}

fn no_physics(shared: &Shared, headers: &HeaderMap, cell: &str) -> Response {
    let text = format!("there are no nightly numbers of a cell `{cell}` here");
    let body = page(shared, headers, |viewer| pages::not_found(viewer, &text));
    (StatusCode::NOT_FOUND, body).into_response()
}

/// Returns the page of a cell's week as a self-contained file.
pub fn week_page(physics: &CellPhysics, notes: &[Note], now_ns: i64) -> String {
    let style = include_str!("web/style.css");
    pages::physics::week(physics, notes, now_ns, Some(style)).into_string()
}

async fn incidents(State(shared): App, headers: HeaderMap) -> Response {
    let reading = shared.clone();
    let read = tokio::task::spawn_blocking(move || {
        reading.hub.kept(|store| {
            let incidents = store.incidents(None, pages::incidents::MOST)?;
            Ok((incidents, store.labels(None, pages::incidents::MOST)?))
        })
    });
    let kept = read.await.ok().flatten();
    let now_ns = shared.hub.snapshot().now_ns;
    page(&shared, &headers, |viewer| {
        pages::incidents::page(viewer, kept, now_ns)
    })
}

async fn login(State(shared): App, headers: HeaderMap) -> Response {
    page(&shared, &headers, |viewer| pages::login(viewer, None))
}

async fn json(State(shared): App) -> Response {
    axum::Json(&*shared.hub.snapshot()).into_response()
}

/// 200 while the fleet host reaches a router or a cell, 503 otherwise.
async fn healthz(State(shared): App) -> Response {
    match shared.hub.snapshot().sessions_reached {
        0 => (StatusCode::SERVICE_UNAVAILABLE, "no router reached\n").into_response(),
        sessions => format!("ok, {sessions} sessions reached\n").into_response(),
    }
}

async fn style() -> impl IntoResponse {
    let kind = [(header::CONTENT_TYPE, "text/css; charset=utf-8")];
    (kind, include_str!("web/style.css"))
}

async fn script() -> impl IntoResponse {
    let kind = [(header::CONTENT_TYPE, "text/javascript; charset=utf-8")];
    (kind, include_str!("web/wall.js"))
}
