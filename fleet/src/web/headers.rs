//! Security headers of every response, and rejection of requests from other sites.

use std::str::FromStr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};

use super::Shared;

/// Content security policy: only resources of this host; no inline script or style.
const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Rejects requests from another site, and adds the headers.
pub async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let refused = (shared.door).refusal(request.method(), request.uri(), request.headers());
    let mut response = match refused {
        Some(refused) => refused.into_response(),
        None => next.run(request).await,
    };
    let set = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "same-origin"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    let headers = response.headers_mut();
    for (name, value) in set {
        headers.insert(name, HeaderValue::from_static(value));
    }
    for name in ["cross-origin-opener-policy", "cross-origin-resource-policy"] {
        headers.insert(name, HeaderValue::from_static("same-origin"));
    }
    response
}

/// Filter of requests.
#[derive(Debug)]
pub struct Door {
    /// Whether only this computer reaches the page.
    pub is_loopback: bool,
    /// Origins under which proxies serve the page.
    pub origins: Vec<Origin>,
}

impl Door {
    fn refusal(
        &self,
        method: &Method,
        uri: &Uri,
        headers: &HeaderMap,
    ) -> Option<(StatusCode, &'static str)> {
        let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
        let host = text("host").or_else(|| uri.authority().map(Authority::as_str));
        let is_ours =
            |host: &str| is_loopback(host) || self.origins.iter().any(|one| one.has_host(host));
        // A page of another site whose name was made to point here (DNS rebinding) has another host.
        if self.is_loopback && !host.is_some_and(is_ours) {
            return Some((
                StatusCode::MISDIRECTED_REQUEST,
                "this host serves only itself; behind a proxy, start it with `--origin https://NAME`\n",
            ));
        }
        if method == Method::GET || method == Method::HEAD {
            return None;
        }
        // Browsers send the origin of a form. Programs send none, and have no cookie that another site could use.
        let elsewhere =
            text("sec-fetch-site").is_some_and(|site| site != "same-origin" && site != "none");
        let origin = text("origin").is_some_and(|origin| {
            let from = origin.split_once("://").map(|(_, from)| from);
            let is_named = || self.origins.iter().any(|one| one.is(origin));
            (from.is_none() || from != host) && !is_named()
        });
        (elsewhere || origin).then_some((
            StatusCode::FORBIDDEN,
            "this form stood on another site; behind a proxy, start the fleet host with `--origin https://NAME`\n",
        ))
    }
}

/// Origin under which a proxy serves the page, its address without the path: `https://fleet.plant`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    scheme: &'static str,
    /// In lower case, with the port unless it is the default of the scheme.
    host: String,
}

/// A text that is not an origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("an origin has a scheme, a name and maybe a port, such as https://fleet.plant")]
pub struct NoOrigin;

impl FromStr for Origin {
    type Err = NoOrigin;

    fn from_str(text: &str) -> Result<Self, NoOrigin> {
        let (scheme, host) = text.split_once("://").ok_or(NoOrigin)?;
        let schemes = ["https", "http"].into_iter();
        let mut schemes = schemes.filter(|known| known.eq_ignore_ascii_case(scheme));
        let scheme = schemes.next().ok_or(NoOrigin)?;
        let host = host.strip_suffix('/').unwrap_or(host);
        let authority: Authority = host.parse().map_err(|_| NoOrigin)?;
        let is_name = !authority.host().is_empty() && !host.contains('@');
        is_name.then_some(()).ok_or(NoOrigin)?;
        Ok(Self {
            scheme,
            host: without_own_port(scheme, host).to_ascii_lowercase(),
        })
    }
}

impl Origin {
    fn is(&self, origin: &str) -> bool {
        origin.parse() == Ok(self.clone())
    }

    fn has_host(&self, host: &str) -> bool {
        without_own_port(self.scheme, host).eq_ignore_ascii_case(&self.host)
    }
}

fn without_own_port<'a>(scheme: &str, host: &'a str) -> &'a str {
    let port = if scheme == "https" { ":443" } else { ":80" };
    host.strip_suffix(port).unwrap_or(host)
}

fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(""),
        None => host.split(':').next().unwrap_or(""),
    };
    let address: Option<std::net::IpAddr> = name.parse().ok();
    name == "localhost" || address.is_some_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn door(origins: &[&str]) -> Door {
        Door {
            is_loopback: true,
            origins: origins.iter().map(|one| one.parse().unwrap()).collect(),
        }
    }

    /// Returns the status with which a form is rejected that a browser sends from `origin` to `host`.
    fn sent(door: &Door, host: &str, origin: &str) -> Option<u16> {
        let mut headers = HeaderMap::new();
        headers.insert("host", host.parse().unwrap());
        headers.insert("origin", origin.parse().unwrap());
        headers.insert("sec-fetch-site", HeaderValue::from_static("same-origin"));
        let refused = door.refusal(&Method::POST, &Uri::from_static("/login"), &headers);
        refused.map(|(status, _)| status.as_u16())
    }

    #[test]
    fn a_form_behind_a_proxy_is_taken_if_its_origin_is_named() {
        let plant = "https://fleet.plant";
        for (origins, host, origin, refused) in [
            (&[][..], "127.0.0.1:7460", "http://127.0.0.1:7460", None),
            // A proxy that passes on `Host`, and one that sets it.
            (&[plant], "fleet.plant", plant, None),
            (&[plant], "fleet.plant:443", plant, None),
            (&[plant], "Fleet.Plant", plant, None),
            (&[plant], "127.0.0.1:7460", plant, None),
            (&["http://b:81", plant], "fleet.plant", plant, None),
            (&[], "fleet.plant", plant, Some(421)),
            (&[], "127.0.0.1:7460", plant, Some(403)),
            (&[plant], "evil.example", "https://evil.example", Some(421)),
            (&[plant], "fleet.plant", "https://evil.example", Some(403)),
            (&[plant], "127.0.0.1", "http://fleet.plant", Some(403)),
            (&[plant], "127.0.0.1", "null", Some(403)),
        ] {
            let got = sent(&door(origins), host, origin);
            assert_eq!(got, refused, "{origins:?} {host} {origin}");
        }
    }

    #[test]
    fn an_origin_has_a_scheme_and_a_name_and_nothing_behind_it() {
        let origin = |text: &str| text.parse::<Origin>();
        for text in ["https://fleet.plant/", "HTTPS://Fleet.Plant:443"] {
            assert_eq!(origin(text), origin("https://fleet.plant"), "{text}");
        }
        for text in [
            "fleet.plant",
            "https://",
            "ftp://a",
            "https://a/b",
            "https://a@b",
        ] {
            assert_eq!(origin(text), Err(NoOrigin), "{text}");
        }
    }

    #[test]
    fn only_names_of_this_computer_are_loopback() {
        for host in ["localhost:8080", "127.0.0.1", "127.8.9.1:1", "[::1]:8080"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["localhost.evil.example", "10.0.0.1", "[::2]:1", "", "["] {
            assert!(!is_loopback(host), "{host}");
        }
    }
}
