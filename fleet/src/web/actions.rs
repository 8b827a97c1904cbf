//! Actions of users: acknowledge, mute, label, note. Each response redirects to the cell's page, which shows the
//! result.

use std::sync::Arc;

use axum::extract::{Form, Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Redirect, Response};
use serde::Deserialize;
use tauscope_bus::command::{Answer, Request, Signed};

use super::{App, Shared, page, pages};
use crate::store::{Label, Note};
use crate::wall::{State as CellState, UnknownWhy};
use crate::words;

/// Maximum length of a note \[bytes\].
/// Resolution: a sentence or two.
const MAX_NOTE_BYTES: usize = 400;

/// A form with only the session's secret.
#[derive(Deserialize)]
pub struct Bare {
    /// Empty if it is missing, as in a request that is not a form of this page.
    #[serde(default)]
    csrf: String,
}

/// A form with a token.
#[derive(Deserialize)]
pub struct Login {
    #[serde(default)]
    token: String,
}

/// A form with the duration of a mute.
#[derive(Deserialize)]
pub struct Mute {
    #[serde(default)]
    csrf: String,
    /// Duration \[s\]; a missing one is rejected.
    seconds: Option<f64>,
}

/// A form with a label or a note.
#[derive(Deserialize)]
pub struct Written {
    #[serde(default)]
    csrf: String,
    #[serde(default)]
    text: String,
    /// `on`: the normal residual of the cell is learned again.
    baseline: Option<String>,
}

/// Response to a rejected action.
type Refused = (StatusCode, &'static str);

pub async fn login(State(shared): App, headers: HeaderMap, Form(form): Form<Login>) -> Response {
    let refused = |why: &str| {
        let body = page(&shared, &headers, |viewer| pages::login(viewer, Some(why)));
        (StatusCode::FORBIDDEN, body).into_response()
    };
    if !shared.sessions.may_try() {
        let text = "too many tries; wait a few seconds\n";
        return (StatusCode::TOO_MANY_REQUESTS, text).into_response();
    }
    let Some(user) = shared.users.of(&form.token) else {
        return refused("this is nobody's token");
    };
    let secure = headers
        .get("x-forwarded-proto")
        .is_some_and(|proto| proto == "https");
    let cookie = shared.sessions.begin(user, secure).ok();
    let cookie = cookie.and_then(|cookie| HeaderValue::from_str(&cookie).ok());
    let Some(cookie) = cookie else {
        return refused("this host has no random numbers");
    };
    ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response()
}

pub async fn logout(State(shared): App, headers: HeaderMap, Form(form): Form<Bare>) -> Response {
    if shared.sessions.of_form(&headers, &form.csrf).is_some() {
        shared.sessions.end(&headers);
    }
    Redirect::to("/").into_response()
}

pub async fn acknowledge(
    State(shared): App,
    Path(cell): Path<String>,
    headers: HeaderMap,
    Form(form): Form<Bare>,
) -> Response {
    let user = match may(&shared, &headers, &form.csrf, &cell) {
        Ok(user) => user,
        Err(refused) => return refused.into_response(),
    };
    let told = if hears(&shared, &cell) {
        let taken = send(&shared, &cell, Request::Acknowledge, &user).await;
        taken.map(holds_from)
    } else {
        Ok("noted here only: the cell takes no commands now".to_owned())
    };
    if told.is_ok() {
        shared.hub.acknowledged(&cell, &user);
    }
    back(&shared, &headers, &cell, told)
}

pub async fn mute(
    State(shared): App,
    Path(cell): Path<String>,
    headers: HeaderMap,
    Form(form): Form<Mute>,
) -> Response {
    let seconds = form.seconds.unwrap_or(f64::NAN);
    let request = Request::Mute { seconds };
    let done = |_: &str, stamp_ns| holds_from(stamp_ns);
    command(&shared, &headers, &form.csrf, &cell, request, done).await
}

pub async fn label(
    State(shared): App,
    Path(cell): Path<String>,
    headers: HeaderMap,
    Form(form): Form<Written>,
) -> Response {
    let text = form.text.trim().to_owned();
    let request = Request::Label { text: text.clone() };
    let done = |user: &str, stamp_ns| {
        let label = Label {
            at_ns: shared.hub.snapshot().now_ns,
            stamp_ns,
            by: user.to_owned(),
            text,
        };
        shared.hub.labelled(&cell, label);
        format!("it is in the archive at {}", words::time(stamp_ns))
    };
    command(&shared, &headers, &form.csrf, &cell, request, done).await
}

pub async fn note(
    State(shared): App,
    Path(cell): Path<String>,
    headers: HeaderMap,
    Form(form): Form<Written>,
) -> Response {
    let by = match may(&shared, &headers, &form.csrf, &cell) {
        Ok(user) => user,
        Err(refused) => return refused.into_response(),
    };
    let text = form.text.trim();
    let sound = (1..=MAX_NOTE_BYTES).contains(&text.len()) && !text.chars().any(char::is_control);
    let told = if sound {
        let note = Note {
            at_ns: shared.hub.snapshot().now_ns,
            by,
            text: text.to_owned(),
            baseline: form.baseline.is_some(),
        };
        shared.hub.note(&cell, note);
        Ok("noted".to_owned())
    } else {
        Err(format!(
            "a note has 1 to {MAX_NOTE_BYTES} bytes of text on one line"
        ))
    };
    back(&shared, &headers, &cell, told)
}

async fn command(
    shared: &Arc<Shared>,
    headers: &HeaderMap,
    csrf: &str,
    cell: &str,
    request: Request,
    done: impl FnOnce(&str, i64) -> String,
) -> Response {
    let user = match may(shared, headers, csrf, cell) {
        Ok(user) => user,
        Err(refused) => return refused.into_response(),
    };
    let told = if hears(shared, cell) {
        let taken = send(shared, cell, request, &user).await;
        taken.map(|stamp_ns| done(&user, stamp_ns))
    } else {
        Err("the cell takes no commands now".to_owned())
    };
    back(shared, headers, cell, told)
}

/// Returns the user of the form, if the cell is known and the user is within the rate limit.
fn may(shared: &Shared, headers: &HeaderMap, csrf: &str, cell: &str) -> Result<String, Refused> {
    let user = shared.sessions.of_form(headers, csrf);
    let user = user.ok_or((
        StatusCode::FORBIDDEN,
        "log in: only users with a token may do this, and a form is good for one log-in\n",
    ))?;
    if shared.hub.snapshot().cell(cell).is_none() {
        return Err((StatusCode::NOT_FOUND, "there is no such cell\n"));
    }
    if !shared.sessions.may_act(&user) {
        let text = "too many commands at once; wait a few seconds\n";
        return Err((StatusCode::TOO_MANY_REQUESTS, text));
    }
    Ok(user)
}

/// Returns whether the cell is connected and its source takes commands.
fn hears(shared: &Shared, cell: &str) -> bool {
    let snapshot = shared.hub.snapshot();
    let Some(view) = snapshot.cell(cell) else {
        return false;
    };
    let is_gone = matches!(view.state, CellState::Ended { .. } | CellState::NeverSeen);
    let takes = view
        .status
        .as_ref()
        .is_some_and(|status| status.takes_commands);
    takes && !is_gone
}

/// Describes the result of an accepted command.
fn holds_from(stamp_ns: i64) -> String {
    let at = words::time(stamp_ns);
    format!("the cell has taken it; it holds from {at} on")
}

/// Returns whether two publishers use this cell name.
fn is_doubled(shared: &Shared, cell: &str) -> bool {
    let two = CellState::Unknown {
        why: UnknownWhy::TwoPublishers,
    };
    let snapshot = shared.hub.snapshot();
    snapshot.cell(cell).is_some_and(|view| view.state == two)
}

/// Sends a command. Returns the stamp from which it takes effect \[ns since the epoch\].
async fn send(
    shared: &Arc<Shared>,
    cell: &str,
    request: Request,
    user: &str,
) -> Result<i64, String> {
    let signed = Signed {
        request,
        by: Some(user.to_owned()),
    };
    signed.command().map_err(|refusal| refusal.to_string())?;
    if is_doubled(shared, cell) {
        return Err("two publishers have this name, and both would take the command".to_owned());
    }
    let (hub, asked) = (shared.hub.clone(), cell.to_owned());
    let answer = tokio::task::spawn_blocking(move || hub.send(&asked, &signed)).await;
    match answer.map_err(|_| "the command could not be sent".to_owned())? {
        Ok(Answer::Taken { stamp_ns }) => Ok(stamp_ns),
        Ok(Answer::Refused { reason }) => Err(format!("the cell refuses: {reason}")),
        Err(error) => Err(error.to_string()),
    }
}

fn back(
    shared: &Shared,
    headers: &HeaderMap,
    cell: &str,
    told: Result<String, String>,
) -> Response {
    shared.sessions.tell(
        headers,
        match told {
            Ok(told) if shared.hub.snapshot().unkept.is_some() => {
                format!("Done: {told}. The fleet host keeps it once its file can be written.")
            }
            Ok(told) => format!("Done: {told}."),
            Err(why) => format!("Not done: {why}."),
        },
    );
    Redirect::to(&format!("/cells/{cell}")).into_response()
}
