//! Sessions of users who are logged in, and their rate limits.
//!
//! A session is a cookie that scripts cannot read and other sites cannot send. Each form also holds a second secret
//! of the session, so that a form of another site would be useless even with the cookie.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::http::{HeaderMap, header};
use subtle::ConstantTimeEq as _;

use super::users::{UsersError, random_hex};

const COOKIE: &str = "tauscope_session";
/// Lifetime of a session. Resolution: a shift and a half.
const LASTS: Duration = Duration::from_hours(12);
/// Maximum number of sessions. Resolution: all people of a plant at two screens each.
const MAX_SESSIONS: usize = 1024;
/// Maximum number of actions at once. Resolution: a person acknowledges ten cells in a row.
const BURST: u32 = 10;
/// Time until one more action is allowed. Resolution: a flood of commands must not starve a cell.
const AGAIN_AFTER: Duration = Duration::from_secs(2);

/// Session of a user who is logged in.
#[derive(Debug, Clone)]
pub struct Session {
    /// The user.
    pub user: String,
    /// Secret in each form of the user.
    pub csrf: String,
    /// Result of the last action, shown once.
    pub told: Option<String>,
    until: Instant,
}

/// A token bucket.
#[derive(Debug, Clone, Copy)]
struct Bucket {
    left: f64,
    at: Instant,
}

impl Bucket {
    fn full(now: Instant) -> Self {
        let left = f64::from(BURST);
        Self { left, at: now }
    }

    fn take(&mut self, now: Instant) -> bool {
        let filled =
            now.saturating_duration_since(self.at).as_secs_f64() / AGAIN_AFTER.as_secs_f64();
        self.left = (self.left + filled).min(f64::from(BURST));
        self.at = now;
        let may = self.left >= 1.0;
        self.left -= f64::from(u8::from(may));
        may
    }
}

#[derive(Debug, Default)]
struct State {
    sessions: BTreeMap<String, Session>,
    /// Rate limits by user; bounded by the number of users.
    buckets: BTreeMap<String, Bucket>,
    logins: Option<Bucket>,
}

/// All sessions.
#[derive(Debug, Default)]
pub struct Sessions(Mutex<State>);

impl Sessions {
    /// Begins a session and returns its cookie. `secure`: the browser connected over TLS.
    ///
    /// # Errors
    /// If the system has no random numbers.
    pub fn begin(&self, user: &str, secure: bool) -> Result<String, UsersError> {
        let (id, csrf) = (random_hex()?, random_hex()?);
        let now = Instant::now();
        let mut state = self.lock();
        state.sessions.retain(|_, session| session.until > now);
        if state.sessions.len() >= MAX_SESSIONS {
            let oldest = state
                .sessions
                .iter()
                .min_by_key(|(_, session)| session.until);
            if let Some(oldest) = oldest.map(|(id, _)| id.clone()) {
                state.sessions.remove(&oldest);
            }
        }
        let session = Session {
            user: user.to_owned(),
            csrf,
            told: None,
            until: now + LASTS,
        };
        state.sessions.insert(id.clone(), session);
        let secure = if secure { "; Secure" } else { "" };
        let age_s = LASTS.as_secs();
        Ok(format!(
            "{COOKIE}={id}; Path=/; HttpOnly; SameSite=Strict; Max-Age={age_s}{secure}"
        ))
    }

    /// Returns the session of a request, and clears its result of the last action.
    pub fn of(&self, headers: &HeaderMap) -> Option<Session> {
        let id = id(headers)?;
        let mut state = self.lock();
        let session = state.sessions.get_mut(&id)?;
        if session.until <= Instant::now() {
            state.sessions.remove(&id);
            return None;
        }
        let given = session.clone();
        session.told = None;
        Some(given)
    }

    /// Returns the user of a form, if the form belongs to that user's session.
    pub fn of_form(&self, headers: &HeaderMap, csrf: &str) -> Option<String> {
        let id = id(headers)?;
        let state = self.lock();
        let session = state.sessions.get(&id)?;
        let same = session.csrf.as_bytes().ct_eq(csrf.as_bytes());
        (bool::from(same) && session.until > Instant::now()).then(|| session.user.clone())
    }

    /// Sets a text that is shown to the user on the next page.
    pub fn tell(&self, headers: &HeaderMap, text: String) {
        let Some(id) = id(headers) else { return };
        if let Some(session) = self.lock().sessions.get_mut(&id) {
            session.told = Some(text);
        }
    }

    /// Ends a session.
    pub fn end(&self, headers: &HeaderMap) {
        if let Some(id) = id(headers) {
            self.lock().sessions.remove(&id);
        }
    }

    /// Returns whether a user may do one more action now.
    pub fn may_act(&self, user: &str) -> bool {
        let now = Instant::now();
        let mut state = self.lock();
        let bucket = state.buckets.entry(user.to_owned());
        bucket.or_insert_with(|| Bucket::full(now)).take(now)
    }

    /// Returns whether a token may be tried now.
    pub fn may_try(&self) -> bool {
        let now = Instant::now();
        let mut state = self.lock();
        state
            .logins
            .get_or_insert_with(|| Bucket::full(now))
            .take(now)
    }

    // Each change is a single step, so a poisoned lock is harmless.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn id(headers: &HeaderMap) -> Option<String> {
    let cookies = headers.get_all(header::COOKIE).iter();
    let texts = cookies.filter_map(|cookie| cookie.to_str().ok());
    let mut pairs = texts.flat_map(|text| text.split(';'));
    pairs.find_map(|pair| {
        let (name, value) = pair.trim().split_once('=')?;
        (name == COOKIE).then(|| value.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(cookie: &str) -> HeaderMap {
        let mut headers = HeaderMap::new();
        let pair = cookie.split(';').next().unwrap();
        headers.insert(header::COOKIE, format!("a=b; {pair}").parse().unwrap());
        headers
    }

    #[test]
    fn a_form_counts_only_with_the_secret_of_its_session() {
        let sessions = Sessions::default();
        let cookie = sessions.begin("anna", false).unwrap();
        assert!(cookie.contains("HttpOnly; SameSite=Strict"), "{cookie}");
        let headers = with(&cookie);
        let csrf = sessions.of(&headers).unwrap().csrf;
        assert_eq!(sessions.of_form(&headers, &csrf).as_deref(), Some("anna"));
        assert_eq!(sessions.of_form(&headers, ""), None);
        let other = with(&sessions.begin("ben", true).unwrap());
        assert_eq!(sessions.of_form(&other, &csrf), None);
        sessions.end(&headers);
        assert!(sessions.of(&headers).is_none());
        assert!(sessions.of(&HeaderMap::new()).is_none());
    }

    #[test]
    fn what_is_told_is_told_once() {
        let sessions = Sessions::default();
        let headers = with(&sessions.begin("anna", false).unwrap());
        sessions.tell(&headers, "done".to_owned());
        assert_eq!(sessions.of(&headers).unwrap().told.as_deref(), Some("done"));
        assert_eq!(sessions.of(&headers).unwrap().told, None);
    }

    #[test]
    fn a_flood_of_actions_is_held_back_and_ends() {
        let now = Instant::now();
        let mut bucket = Bucket::full(now);
        let taken = (0..100).filter(|_| bucket.take(now)).count();
        assert_eq!(taken, BURST as usize);
        assert!(bucket.take(now + AGAIN_AFTER));
        assert!(!bucket.take(now + AGAIN_AFTER));
    }

    #[test]
    fn memory_is_bounded() {
        let sessions = Sessions::default();
        for _ in 0..MAX_SESSIONS + 3 {
            sessions.begin("anna", false).unwrap();
        }
        assert_eq!(sessions.lock().sessions.len(), MAX_SESSIONS);
    }
}
