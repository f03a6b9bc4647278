//! Routes, headers and answers.

use std::future::poll_fn;
use std::net::IpAddr;
use std::pin::pin;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::time::Duration;

use axum::body::{Body, HttpBody};
use axum::extract::State;
use axum::http::header::{self, HeaderMap, HeaderName, HeaderValue};
use axum::http::{self, Method, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::timeout;
use tower_service::Service;

use super::checks;
use super::connections::{Phase, Progress};
use super::events::{Events, Hub};
use super::readers::Readers;
use super::{Asset, Reply, Request};

/// Readers of events at once.
const MAX_READERS: usize = 32;

/// Longest body of an action \[bytes\].
const MAX_BODY: usize = 4096;

/// Longest time in which the body of an action arrives.
const BODY_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time in which the service answers an action.
const REPLY_TIMEOUT: Duration = Duration::from_secs(5);

const EVENTS: &str = "/events";
const ACTION: &str = "/action";

const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Headers of every answer.
const PROTECTION: [(HeaderName, &str); 5] = [
    (header::CONTENT_SECURITY_POLICY, POLICY),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::CACHE_CONTROL, "no-store"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// An answer that refuses a request, with cause and remedy.
#[derive(Debug)]
pub(super) struct Refusal(StatusCode, String);

impl Refusal {
    pub(super) fn new(status: StatusCode, reason: impl Into<String>) -> Self {
        Self(status, reason.into())
    }

    fn header(&self) -> Option<(HeaderName, &'static str)> {
        match self.0 {
            StatusCode::UNAUTHORIZED => Some((header::WWW_AUTHENTICATE, "Bearer")),
            StatusCode::SERVICE_UNAVAILABLE => Some((header::RETRY_AFTER, "1")),
            _ => None,
        }
    }

    fn json(&self) -> String {
        json!({ "error": self.1 }).to_string()
    }

    /// The whole answer as text, for a request that was not read.
    pub(super) fn text(&self) -> String {
        let json = self.json();
        let mut text = format!("HTTP/1.1 {}\r\n", self.0);
        let length = json.len().to_string();
        let own = [
            (header::CONTENT_TYPE, "application/json"),
            (header::CONTENT_LENGTH, length.as_str()),
            (header::CONNECTION, "close"),
        ];
        for (name, value) in own.iter().chain(&PROTECTION) {
            for part in [name.as_str(), ": ", value, "\r\n"] {
                text.push_str(part);
            }
        }
        text + "\r\n" + &json
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let json = [(header::CONTENT_TYPE, "application/json")];
        (self.0, json, self.header().map(|header| [header]), self.json()).into_response()
    }
}

/// All that answers need.
pub(super) struct Server {
    names: Vec<String>,
    router: Router,
}

struct Parts {
    hub: Arc<Hub>,
    token: String,
    assets: &'static [Asset],
    requests: SyncSender<Request>,
    readers: Arc<Readers>,
}

impl Server {
    pub(super) fn new(
        hub: Arc<Hub>,
        token: String,
        names: Vec<String>,
        assets: &'static [Asset],
        requests: SyncSender<Request>,
    ) -> Self {
        let readers = Readers::new(MAX_READERS);
        let parts = Parts { hub, token, assets, requests, readers };
        let router = Router::new()
            .route(EVENTS, get(events))
            .route(ACTION, post(action))
            .method_not_allowed_fallback(not_allowed)
            .fallback(asset)
            .with_state(Arc::new(parts));
        Self { names, router }
    }

    /// Answers a request, and tells the phase of its connection.
    pub(super) async fn answer(
        &self,
        mut request: http::Request<hyper::body::Incoming>,
        progress: Arc<Progress>,
        address: IpAddr,
    ) -> Response {
        request.extensions_mut().insert(progress);
        request.extensions_mut().insert(address);
        let mut response = match self.check_target(request.uri(), request.headers()) {
            Ok(()) => self.router.clone().call(request).await.into_response(),
            Err(refusal) => refusal.into_response(),
        };
        for (name, value) in PROTECTION {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response
    }

    fn check_target(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refusal> {
        if uri.authority().is_some() || !uri.path().starts_with('/') {
            return Err(Refusal::new(StatusCode::BAD_REQUEST, "the target of a request is a path"));
        }
        let Some(host) = checks::host(headers) else {
            return Err(Refusal::new(StatusCode::BAD_REQUEST, "a request has one header Host"));
        };
        if checks::is_own(host, &self.names) {
            return Ok(());
        }
        let reason = "the page is not known under this host name: open it by the IP address of this computer, or add the name to the configuration";
        Err(Refusal::new(StatusCode::FORBIDDEN, reason))
    }
}

fn check_site(headers: &HeaderMap) -> Result<(), Refusal> {
    if checks::is_cross_site(headers) {
        let reason = "the request comes from a page of another site; open the page of hydroid itself";
        return Err(Refusal::new(StatusCode::FORBIDDEN, reason));
    }
    Ok(())
}

async fn not_allowed(uri: Uri) -> Refusal {
    let methods = if uri.path() == ACTION { "POST" } else { "GET and HEAD" };
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, format!("this address accepts {methods} alone"))
}

async fn asset(State(parts): State<Arc<Parts>>, method: Method, uri: Uri) -> Response {
    let Some(asset) = parts.assets.iter().find(|asset| asset.path == uri.path()) else {
        return Refusal::new(StatusCode::NOT_FOUND, "there is no such page").into_response();
    };
    if method != Method::GET && method != Method::HEAD {
        return ([(header::ALLOW, "GET,HEAD")], not_allowed(uri).await).into_response();
    }
    ([(header::CONTENT_TYPE, asset.content_type)], asset.content).into_response()
}

async fn events(
    State(parts): State<Arc<Parts>>,
    Extension(progress): Extension<Arc<Progress>>,
    Extension(address): Extension<IpAddr>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    check_site(&headers)?;
    let place = parts.readers.take(address).ok_or_else(|| {
        let reason = format!("{MAX_READERS} pages are open already; close one of them");
        Refusal::new(StatusCode::SERVICE_UNAVAILABLE, reason)
    })?;
    progress.enter(Phase::Events);
    let body = Body::new(Events::new(parts.hub.clone(), place));
    Ok(([(header::CONTENT_TYPE, "text/event-stream")], body).into_response())
}

async fn action(
    State(parts): State<Arc<Parts>>,
    Extension(progress): Extension<Arc<Progress>>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Refusal> {
    check_site(&headers)?;
    if !checks::has_token(&headers, &parts.token) {
        let reason = "the token is missing or wrong: use the address that hydroid printed at its start";
        return Err(Refusal::new(StatusCode::UNAUTHORIZED, reason));
    }
    progress.enter(Phase::Action);
    if !is_json(&headers) {
        return Err(Refusal::new(StatusCode::BAD_REQUEST, "an action has the Content-Type application/json"));
    }
    let late =
        |_| Refusal::new(StatusCode::REQUEST_TIMEOUT, "the action did not arrive in time; send it again");
    let body = timeout(BODY_TIMEOUT, read(body)).await.map_err(late)??;
    let action: Value = serde_json::from_slice(&body)
        .map_err(|error| Refusal::new(StatusCode::BAD_REQUEST, format!("the action is not JSON: {error}")))?;
    if !action.get("action").is_some_and(Value::is_string) {
        let reason = "an action is a JSON object as in {\"action\": \"stop\"}";
        return Err(Refusal::new(StatusCode::BAD_REQUEST, reason));
    }
    let done = ask(&parts.requests, action).await?;
    Ok(([(header::CONTENT_TYPE, "application/json")], json!({ "done": done }).to_string()).into_response())
}

/// Lets the service do an action.
async fn ask(requests: &SyncSender<Request>, action: Value) -> Result<String, Refusal> {
    let unavailable = |reason: &str| Refusal::new(StatusCode::SERVICE_UNAVAILABLE, reason);
    let (reply, answer) = oneshot::channel();
    requests.try_send(Request { action, reply: Reply(reply) }).map_err(|error| match error {
        TrySendError::Full(_) => unavailable("the service has too many actions to do; nothing was done"),
        TrySendError::Disconnected(_) => unavailable("the service has ended; nothing was done"),
    })?;
    match timeout(REPLY_TIMEOUT, answer).await {
        Ok(Ok(Ok(done))) => Ok(done),
        Ok(Ok(Err(reason))) => Err(Refusal::new(StatusCode::CONFLICT, reason)),
        Ok(Err(_)) => Err(unavailable("the service gave no answer; look whether the action was done")),
        Err(_) => Err(unavailable("the service does not answer; look whether the action was done")),
    }
}

fn is_json(headers: &HeaderMap) -> bool {
    let content_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let media_type = content_type.and_then(|value| value.split(';').next());
    media_type.is_some_and(|media_type| media_type.trim().eq_ignore_ascii_case("application/json"))
}

async fn read(body: Body) -> Result<Vec<u8>, Refusal> {
    let too_large = || {
        let reason = format!("an action has at most {MAX_BODY} bytes");
        Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, reason)
    };
    if body.size_hint().lower() > MAX_BODY as u64 {
        return Err(too_large());
    }
    let (mut body, mut content) = (pin!(body), Vec::new());
    while let Some(frame) = poll_fn(|context| body.as_mut().poll_frame(context)).await {
        let broken = |_| Refusal::new(StatusCode::BAD_REQUEST, "the action is incomplete; send it again");
        let frame = frame.map_err(broken)?;
        let Some(data) = frame.data_ref() else { continue };
        if content.len() + data.len() > MAX_BODY {
            return Err(too_large());
        }
        content.extend_from_slice(data);
    }
    Ok(content)
}
