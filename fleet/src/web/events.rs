//! The wall as server-sent events: first all tiles, then those that have changed.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream;
use serde::Serialize;
use tokio::sync::{OwnedSemaphorePermit, watch};

use super::{App, Shared, pages};
use crate::wall::Snapshot;

/// Update interval of a page. Resolution: ages are shown in seconds.
const EVERY: Duration = Duration::from_millis(500);
/// Longest interval between events without a change. Resolution: a page reports itself as cut off after 5 s.
const AT_LEAST: Duration = Duration::from_secs(2);

/// Content of an event.
#[derive(Debug, Serialize)]
struct News {
    /// The line above the tiles, as HTML.
    summary: String,
    /// The cells in their order, if that has changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    order: Option<Vec<String>>,
    /// The tiles that have changed, as HTML.
    tiles: BTreeMap<String, String>,
}

struct Follower {
    snapshots: watch::Receiver<Arc<Snapshot>>,
    /// The cell of the page, if it shows a single cell.
    only: Option<String>,
    order: Vec<String>,
    tiles: BTreeMap<String, String>,
    told: Option<tokio::time::Instant>,
    _place: OwnedSemaphorePermit,
}

/// Streams the events of all cells.
pub async fn all(State(shared): App) -> Response {
    follow(&shared, None)
}

/// Streams the events of one cell.
pub async fn one(State(shared): App, Path(cell): Path<String>) -> Response {
    follow(&shared, Some(cell))
}

fn follow(shared: &Shared, only: Option<String>) -> Response {
    let Ok(place) = shared.followers.clone().try_acquire_owned() else {
        let text = "too many pages follow the wall\n";
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    let follower = Follower {
        snapshots: shared.hub.snapshots(),
        only,
        order: Vec::new(),
        tiles: BTreeMap::new(),
        told: None,
        _place: place,
    };
    Sse::new(stream::unfold(follower, next)).into_response()
}

async fn next(mut follower: Follower) -> Option<(Result<Event, Infallible>, Follower)> {
    loop {
        if follower.told.is_some() {
            tokio::time::sleep(EVERY).await;
        }
        if follower.snapshots.has_changed().is_err() {
            return None;
        }
        let snapshot = follower.snapshots.borrow_and_update().clone();
        let news = follower.news(&snapshot);
        let is_due = follower.told.is_none_or(|told| told.elapsed() >= AT_LEAST);
        if news.tiles.is_empty() && news.order.is_none() && !is_due {
            continue;
        }
        follower.told = Some(tokio::time::Instant::now());
        let Ok(event) = Event::default().event("wall").json_data(&news) else {
            return None;
        };
        return Some((Ok(event), follower));
    }
}

impl Follower {
    fn news(&mut self, snapshot: &Snapshot) -> News {
        let only = self.only.as_ref();
        let views = || {
            snapshot
                .cells
                .iter()
                .filter(|view| only.is_none_or(|only| view.cell == *only))
        };
        let order: Vec<String> = views().map(|view| view.cell.clone()).collect();
        let mut tiles = BTreeMap::new();
        for view in views() {
            let tile = pages::tile::tile(view, snapshot.now_ns).into_string();
            if self.tiles.get(&view.cell) != Some(&tile) {
                self.tiles.insert(view.cell.clone(), tile.clone());
                tiles.insert(view.cell.clone(), tile);
            }
        }
        let is_new = order != self.order;
        self.order.clone_from(&order);
        News {
            summary: pages::wall::summary(snapshot).into_string(),
            order: is_new.then_some(order),
            tiles,
        }
    }
}
