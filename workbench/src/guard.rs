//! Access control: requests are accepted only from this machine and from the page of this run.
//!
//! A browser also runs pages of other sites, and these can reach loopback. Three checks exclude them. The token of
//! this run is only in the opened address. The `Host` header cannot be forged by a name that was rebound to
//! 127.0.0.1. A page of another site cannot omit `Origin` and `Sec-Fetch-Site` in a request that changes something.

use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, HOST, HeaderMap, HeaderName, HeaderValue, ORIGIN, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Conditions that a request must meet.
#[derive(Debug, Clone)]
pub(crate) struct Guard {
    token: String,
    port: u16,
}

impl Guard {
    /// A guard with its own token; fails if the system provides no random numbers.
    pub(crate) fn new(port: u16) -> std::io::Result<Self> {
        let mut bytes = [0u8; 24];
        getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
        let token = bytes.iter().map(|b| format!("{b:02x}")).collect();
        Ok(Self { token, port })
    }

    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    fn own(&self, authority: &str) -> bool {
        let Some((name, port)) = authority.rsplit_once(':') else {
            return false;
        };
        matches!(name, "127.0.0.1" | "localhost") && port.parse() == Ok(self.port)
    }

    fn check(&self, request: &Request) -> Result<(), &'static str> {
        let headers = request.headers();
        let text = |name: &HeaderName| headers.get(name).map(|v| v.to_str().unwrap_or("\0"));
        // There must be exactly one `Host` header, with the server's own address.
        let single = headers.get_all(HOST).iter().count() == 1;
        if !(single && text(&HOST).is_some_and(|host| self.own(host))) {
            return Err("this address does not belong to the workbench; open the printed one");
        }
        if let Some(origin) = text(&ORIGIN)
            && !origin.strip_prefix("http://").is_some_and(|o| self.own(o))
        {
            return Err("a page of another site must not send requests to the workbench");
        }
        let site = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
        if !matches!(site, None | Some(b"same-origin" | b"none")) {
            return Err("a page of another site must not send requests to the workbench");
        }
        let given = match headers.get("x-token") {
            Some(token) => Some(token.as_bytes()),
            // Only requests that change nothing may carry the token in the address: links to files, and the page
            // itself.
            None if request.method() == Method::GET => {
                let pairs = request.uri().query().unwrap_or("").split('&');
                let mut found = pairs.filter_map(|pair| pair.strip_prefix("token="));
                found.next().map(str::as_bytes)
            }
            None => None,
        };
        if !given.is_some_and(|given| same(given, self.token.as_bytes())) {
            return Err(
                "the token of this run is missing; open the address that the workbench printed",
            );
        }
        Ok(())
    }
}

/// Comparison in a time that does not depend on the position of the first difference.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

pub(crate) async fn guard(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let mut response = match guard.check(&request) {
        Ok(()) => next.run(request).await,
        Err(why) => (StatusCode::FORBIDDEN, why).into_response(),
    };
    harden(response.headers_mut());
    response
}

fn harden(headers: &mut HeaderMap) {
    for (name, value) in [
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (X_FRAME_OPTIONS, "DENY"),
        // The token is in the address, so the address must not be sent to other sites.
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "same-origin",
        ),
        (
            HeaderName::from_static("cross-origin-opener-policy"),
            "same-origin",
        ),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
}
