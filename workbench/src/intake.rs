//! Limits of size and time for incoming requests, applied before anything is stored.

use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::http::header::CONTENT_LENGTH;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde_json::json;
use tokio::sync::Semaphore;
use tokio::time::timeout;

/// The largest request, bytes.
pub(crate) const LARGEST: usize = 256 << 10;
/// The largest file that is uploaded, bytes; one at a time.
pub(crate) const LARGEST_FILE: usize = 512 << 20;
/// Address to which files are uploaded.
pub(crate) const UPLOAD: &str = "/api/upload/";

/// Connections at a time: a browser opens six, and events hold one for each page.
const CONNECTIONS: usize = 64;
/// Longest time for the head of a request; the browser is on the same machine.
const HEAD: Duration = Duration::from_millis(if cfg!(test) { 200 } else { 10_000 });
/// Longest time for a request, and for a file.
const BODY: Duration = Duration::from_secs(10);
const FILE: Duration = Duration::from_secs(120);

/// Files are uploaded one at a time, because each is held in memory until it is stored.
#[derive(Clone, Debug)]
pub(crate) struct Uploads(Arc<Semaphore>);

impl Uploads {
    pub(crate) fn new() -> Self {
        Self(Arc::new(Semaphore::new(1)))
    }
}

/// Reads a request's content or refuses it: by its stated length before a byte is read, otherwise by the received
/// length.
pub(crate) async fn take_in(
    State(uploads): State<Uploads>,
    request: Request,
    next: Next,
) -> Response {
    let is_file = request.uri().path().starts_with(UPLOAD);
    let (largest, patience) = if is_file {
        (LARGEST_FILE, FILE)
    } else {
        (LARGEST, BODY)
    };
    let stated = request.headers().get(CONTENT_LENGTH);
    let stated = stated.and_then(|n| n.to_str().ok()?.parse::<u64>().ok());
    if stated.is_some_and(|n| n > largest as u64) {
        return refused(StatusCode::PAYLOAD_TOO_LARGE, &too_large(largest));
    }
    let _turn = match is_file.then(|| uploads.0.try_acquire()).transpose() {
        Ok(turn) => turn,
        Err(_) => {
            let why = "another file is being uploaded; wait for it";
            return refused(StatusCode::CONFLICT, why);
        }
    };
    let (head, body) = request.into_parts();
    match timeout(patience, to_bytes(body, largest)).await {
        Ok(Ok(bytes)) => next.run(Request::from_parts(head, Body::from(bytes))).await,
        Ok(Err(_)) => refused(StatusCode::PAYLOAD_TOO_LARGE, &too_large(largest)),
        Err(_) => refused(
            StatusCode::REQUEST_TIMEOUT,
            "the request was incomplete; send it again",
        ),
    }
}

fn too_large(largest: usize) -> String {
    format!(
        "the file is incomplete or larger than {} kB; import larger files with `host-fit import`",
        largest >> 10
    )
}

fn refused(status: StatusCode, why: &str) -> Response {
    (status, axum::Json(json!({"error": why}))).into_response()
}

/// Serves until the process ends. A connection without a complete request is closed.
pub(crate) async fn serve(listener: TcpListener, router: Router) -> std::io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let place = places.clone().acquire_owned().await;
        let (stream, _) = match listener.accept().await {
            Ok(accepted) => accepted,
            // If there are no free file descriptors, the server waits until some are free.
            Err(_) => {
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let mut http = hyper::server::conn::http1::Builder::new();
            http.timer(TokioTimer::new()).header_read_timeout(HEAD);
            // A page that is closed meanwhile is not an error.
            let _ = http.serve_connection(TokioIo::new(stream), service).await;
            drop(place);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::{Ipv4Addr, TcpStream};
    use std::time::Instant;

    /// An incomplete head occupies a connection only for a short time, and other requests are answered meanwhile.
    #[test]
    fn a_request_that_does_not_come_is_closed() {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build();
            let router = Router::new().route("/", axum::routing::get(|| async { "here" }));
            let _ = runtime.unwrap().block_on(serve(listener, router));
        });
        let mut slow = TcpStream::connect(address).unwrap();
        slow.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n").unwrap();
        slow.set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        let mut other = TcpStream::connect(address).unwrap();
        let whole = b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
        other.write_all(whole).unwrap();
        let mut text = String::new();
        other.read_to_string(&mut text).unwrap();
        assert!(text.contains("200 OK") && text.ends_with("here"), "{text}");
        let from = Instant::now();
        let mut rest = Vec::new();
        slow.read_to_end(&mut rest).unwrap();
        assert!(
            from.elapsed() < Duration::from_secs(10),
            "{:?}",
            from.elapsed()
        );
    }
}
