//! Requests and their responses.

use std::convert::Infallible;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, RawQuery, State};
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_util::stream;
use serde_json::{Value, json};
use tokio::sync::broadcast::error::RecvError;

use crate::guard::{Guard, guard};
use crate::intake;
use crate::work::Work;

/// Why a request failed: one paragraph with the remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal(pub String);

impl<E: std::error::Error> From<E> for Refusal {
    fn from(error: E) -> Self {
        let mut text = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            let words = inner.to_string();
            if !text.contains(&words) {
                text.push_str(": ");
                text.push_str(&words);
            }
            cause = inner.source();
        }
        Self(text)
    }
}

/// A file to be saved by the browser.
#[derive(Debug, Clone)]
pub struct Download {
    /// Name of the file.
    pub name: String,
    /// Media type, for example `text/html`.
    pub kind: &'static str,
    /// Content of the file.
    pub content: Vec<u8>,
}

/// The actions of the workbench. Every method may be called from several threads; [`Bench::run`] from one at a
/// time.
pub trait Bench: Send + Sync + 'static {
    /// The page.
    fn page(&self) -> String;
    /// The state without the curves, as a JSON document.
    fn state(&self) -> Value;
    /// Records with the free runs of some models, in the form that the page's script draws.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn records(&self, models: &[u32]) -> Result<String, Refusal>;
    /// A request that is answered at once: choosing another model.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn select(&self, model: u32) -> Result<(), Refusal>;
    /// Answers other quick queries and makes quick changes. Question and answer are JSON documents.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn ask(&self, question: &Value) -> Result<Value, Refusal>;
    /// Stores a user's file and returns its contents. `name` is chosen by the page.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn upload(&self, name: &str, content: &[u8]) -> Result<Value, Refusal>;
    /// The name of the task, if the request is valid; checked before it starts.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn name(&self, request: &Value) -> Result<String, Refusal>;
    /// Runs a task.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn run(&self, request: &Value, work: &Work) -> Result<(), Refusal>;
    /// A file made of a model.
    ///
    /// # Errors
    /// [`Refusal`] in words for the user.
    fn file(&self, kind: &str, model: u32) -> Result<Download, Refusal>;
}

struct Shared<B> {
    bench: B,
    work: Work,
}

type At<B> = State<Arc<Shared<B>>>;

/// Serves `bench` on loopback until the process ends; `port` 0 is any free one. `ready` receives the address, with
/// this run's token.
///
/// # Errors
/// If the port cannot be opened.
pub fn serve(bench: impl Bench, port: u16, ready: impl FnOnce(&str)) -> std::io::Result<()> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
    listener.set_nonblocking(true)?;
    let guard = Guard::new(listener.local_addr()?.port())?;
    let address = format!("http://{}/?token={}", listener.local_addr()?, guard.token());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        ready(&address);
        intake::serve(listener, router(bench, guard)).await
    })
}

fn router<B: Bench>(bench: B, rules: Guard) -> Router {
    let shared = Arc::new(Shared {
        bench,
        work: Work::new(),
    });
    Router::new()
        .route("/", get(page::<B>))
        .route("/api/state", get(state::<B>))
        .route("/api/records", get(records::<B>))
        .route("/api/events", get(events::<B>))
        .route("/api/select", post(select::<B>))
        .route("/api/ask", post(ask::<B>))
        .route("/api/upload/{name}", post(upload::<B>))
        .route("/api/run", post(run::<B>))
        .route("/api/cancel", post(cancel::<B>))
        .route("/api/file/{kind}/{model}", get(file::<B>))
        .with_state(shared)
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn_with_state(
            intake::Uploads::new(),
            intake::take_in,
        ))
        // The guard runs first, so that the content of a foreign request is never read.
        .layer(middleware::from_fn_with_state(rules, guard))
}

/// Runs a longer action without blocking other requests.
async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refused> {
    match tokio::task::spawn_blocking(work).await {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(why)) => Err(refused(StatusCode::UNPROCESSABLE_ENTITY, &why.0)),
        // A panic in the library is a fault of the tool, but the server continues.
        Err(_) => Err(refused(
            StatusCode::INTERNAL_SERVER_ERROR,
            "the request failed because of a fault in the program; please report the fault with the log of the project",
        )),
    }
}

/// Why a request was not answered, in the form sent to the page.
struct Refused(StatusCode, String);

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        (self.0, axum::Json(json!({"error": self.1}))).into_response()
    }
}

fn refused(status: StatusCode, why: &str) -> Refused {
    Refused(status, why.to_owned())
}

fn json_text(text: String) -> Response {
    ([(CONTENT_TYPE, "application/json")], text).into_response()
}

fn read(body: &Bytes) -> Result<Value, Refused> {
    serde_json::from_slice(body)
        .map_err(|e| refused(StatusCode::BAD_REQUEST, &format!("no JSON document: {e}")))
}

async fn page<B: Bench>(State(shared): At<B>) -> Response {
    axum::response::Html(shared.bench.page()).into_response()
}

async fn state<B: Bench>(State(shared): At<B>) -> Result<Response, Refused> {
    let state = aside({
        let shared = shared.clone();
        move || Ok(shared.bench.state())
    })
    .await?;
    let mut state = state;
    if let Some(object) = state.as_object_mut() {
        object.insert("work".to_owned(), shared.work.state());
    }
    Ok(axum::Json(state).into_response())
}

async fn records<B: Bench>(
    State(shared): At<B>,
    RawQuery(query): RawQuery,
) -> Result<Response, Refused> {
    const MOST: usize = 6;
    let query = query.unwrap_or_default();
    let list = query
        .split('&')
        .find_map(|pair| pair.strip_prefix("models="));
    let numbers = list.unwrap_or("").split(',').filter(|t| !t.is_empty());
    let models: Vec<u32> = numbers
        .map(str::parse)
        .collect::<Result<_, _>>()
        .map_err(|_| refused(StatusCode::BAD_REQUEST, "models are numbers: models=1,3"))?;
    if models.len() > MOST {
        let why = format!("at most {MOST} models are shown at once");
        return Err(refused(StatusCode::BAD_REQUEST, &why));
    }
    aside(move || shared.bench.records(&models))
        .await
        .map(json_text)
}

async fn select<B: Bench>(State(shared): At<B>, body: Bytes) -> Result<Response, Refused> {
    let request = read(&body)?;
    let model = request.get("model").and_then(Value::as_u64);
    let model = model
        .and_then(|m| u32::try_from(m).ok())
        .ok_or_else(|| refused(StatusCode::BAD_REQUEST, "`model` is the number of a model"))?;
    let work = shared.work.clone();
    aside(move || shared.bench.select(model)).await?;
    work.tell(&json!({"kind": "changed"}));
    Ok(json_text("{}".to_owned()))
}

async fn ask<B: Bench>(State(shared): At<B>, body: Bytes) -> Result<Response, Refused> {
    let question = read(&body)?;
    let answer = aside(move || shared.bench.ask(&question)).await?;
    Ok(axum::Json(answer).into_response())
}

async fn upload<B: Bench>(
    State(shared): At<B>,
    Path(name): Path<String>,
    body: Bytes,
) -> Result<Response, Refused> {
    let work = shared.work.clone();
    let told = aside(move || shared.bench.upload(&name, &body)).await?;
    work.tell(&json!({"kind": "changed"}));
    Ok(axum::Json(told).into_response())
}

async fn run<B: Bench>(State(shared): At<B>, body: Bytes) -> Result<Response, Refused> {
    let request = read(&body)?;
    let name = shared
        .bench
        .name(&request)
        .map_err(|why| refused(StatusCode::BAD_REQUEST, &why.0))?;
    if !shared.work.begin(&name) {
        let why = "a task is running already; wait for it, or cancel it";
        return Err(refused(StatusCode::CONFLICT, why));
    }
    // The request does not wait for the task; an event informs the page of its end.
    tokio::task::spawn_blocking(move || {
        let work = shared.work.clone();
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            shared.bench.run(&request, &work)
        }));
        let error = match done {
            Ok(Ok(())) => None,
            Ok(Err(why)) => Some(why.0),
            Err(_) => Some(
                "the step failed because of a fault in the program; please report the fault with the log of the project"
                    .to_owned(),
            ),
        };
        work.end(error.as_deref());
    });
    Ok((StatusCode::ACCEPTED, json_text("{}".to_owned())).into_response())
}

async fn cancel<B: Bench>(State(shared): At<B>) -> Response {
    shared.work.ask_to_end();
    json_text("{}".to_owned())
}

async fn file<B: Bench>(
    State(shared): At<B>,
    Path((kind, model)): Path<(String, String)>,
) -> Result<Response, Refused> {
    let model = model
        .parse()
        .map_err(|_| refused(StatusCode::BAD_REQUEST, "a model's number is needed"))?;
    let file = aside(move || shared.bench.file(&kind, model)).await?;
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    let name: String = file.name.chars().filter(|c| plain(*c)).collect();
    let disposition = format!("attachment; filename=\"{name}\"");
    let mut response = file.content.into_response();
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(file.kind));
    if let Ok(value) = HeaderValue::from_str(&disposition) {
        headers.insert(CONTENT_DISPOSITION, value);
    }
    Ok(response)
}

async fn events<B: Bench>(State(shared): At<B>) -> Response {
    let told = stream::unfold(shared.work.listen(), |mut events| async move {
        let text = match events.recv().await {
            Ok(text) => text,
            // A page that missed events requests the whole state.
            Err(RecvError::Lagged(_)) => json!({"kind": "changed"}).to_string(),
            Err(RecvError::Closed) => return None,
        };
        Some((Ok::<_, Infallible>(Event::default().data(text)), events))
    });
    Sse::new(told)
        .keep_alive(KeepAlive::default())
        .into_response()
}

#[cfg(test)]
mod tests;
