//! Buckets of S3 and what speaks its protocol. Credentials, region and endpoint come from the usual variables:
//! `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_SESSION_TOKEN`, `AWS_REGION` and `AWS_ENDPOINT_URL`.
//!
//! Requests go over ureq, the client that webhooks use, too: the crate's own client would bring a second TLS stack.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use bytes::{Buf as _, Bytes};
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpRequestBody, HttpResponse, HttpService,
};
use object_store::prefix::PrefixStore;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use ureq::http::header::CONTENT_LENGTH;
use ureq::http::{Request, Uri};

/// Time for a connection.
const CONNECT_TIME: Duration = Duration::from_secs(3);

/// Time for a request and its answer. The largest mesh passes in it at some megabytes a second.
const CALL_TIME: Duration = Duration::from_secs(60);

/// Time from the end of a request to the beginning of its answer.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// Attempts after the first, and the time within which they begin.
const RETRIES: usize = 3;
const RETRY_TIME: Duration = Duration::from_secs(20);

/// The store under a prefix of a bucket. The error is a sentence.
pub fn open(bucket: &str, prefix: &str) -> Result<Arc<dyn ObjectStore>, String> {
    let backoff =
        BackoffConfig { init_backoff: Duration::from_millis(100), max_backoff: Duration::from_secs(2), base: 2.0 };
    let retry = RetryConfig { backoff, max_retries: RETRIES, retry_timeout: RETRY_TIME };
    let builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_allow_http(true).with_retry(retry);
    if let Some(endpoint) = builder.get_config_value(&AmazonS3ConfigKey::Endpoint) {
        check_endpoint(&endpoint)?;
    }
    // One object is deleted at a time, and not every server of S3 knows how to delete several.
    let store = builder.with_disable_bulk_delete(true).with_http_connector(Connector).build();
    let store = store.map_err(|error| error.to_string())?;
    Ok(Arc::new(PrefixStore::new(store, prefix)))
}

/// Refuses an endpoint with which the crate would panic, or wait for ever.
fn check_endpoint(endpoint: &str) -> Result<(), String> {
    let uri = endpoint.parse::<Uri>().ok().filter(|uri| uri.host().is_some());
    let is_http = uri.is_some_and(|uri| matches!(uri.scheme_str(), Some("http" | "https")));
    is_http
        .then_some(())
        .ok_or_else(|| format!("AWS_ENDPOINT_URL is `{endpoint}`, and must begin with http:// or https://"))
}

#[derive(Debug)]
struct Connector;

impl HttpConnector for Connector {
    fn connect(&self, _: &ClientOptions) -> object_store::Result<HttpClient> {
        let config = ureq::Agent::config_builder()
            .timeout_connect(Some(CONNECT_TIME))
            .timeout_recv_response(Some(ANSWER_TIME))
            .timeout_global(Some(CALL_TIME))
            // Redirects lose the signature.
            .max_redirects(0)
            .max_redirects_will_error(false)
            .http_status_as_error(false)
            .user_agent(concat!("meshsnap/", env!("CARGO_PKG_VERSION")))
            .build();
        Ok(HttpClient::new(Client(config.new_agent())))
    }
}

#[derive(Debug)]
struct Client(ureq::Agent);

#[async_trait::async_trait]
impl HttpService for Client {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        let agent = self.0.clone();
        let sending = tokio::task::spawn_blocking(move || send(&agent, request));
        sending.await.map_err(|error| HttpError::new(HttpErrorKind::Unknown, error))?
    }
}

/// Sends a request and reads the answer. It blocks its thread.
fn send(agent: &ureq::Agent, request: HttpRequest) -> Result<HttpResponse, HttpError> {
    let (mut parts, body) = request.into_parts();
    // Without a length the body would be sent in chunks, which S3 refuses.
    parts.headers.insert(CONTENT_LENGTH, body.content_length().into());
    let sent = if body.content_length() == 0 {
        agent.run(Request::from_parts(parts, ()))
    } else {
        let mut chunks = Chunks::of(body);
        agent.run(Request::from_parts(parts, ureq::SendBody::from_reader(&mut chunks)))
    };
    let (parts, mut body) = sent.map_err(error_of)?.into_parts();
    let length = body.content_length().and_then(|length| usize::try_from(length).ok()).unwrap_or(0);
    let mut bytes = Vec::new();
    // As much as is needed and no more, because the bytes of a mesh stay. The store is trusted, yet not with all memory.
    bytes.try_reserve_exact(length).map_err(|error| HttpError::new(HttpErrorKind::Unknown, error))?;
    body.as_reader().read_to_end(&mut bytes).map_err(|error| error_of(error.into()))?;
    Ok(HttpResponse::from_parts(parts, Bytes::from(bytes).into()))
}

fn error_of(error: ureq::Error) -> HttpError {
    let kind = match &error {
        ureq::Error::Timeout(_) => HttpErrorKind::Timeout,
        ureq::Error::ConnectionFailed | ureq::Error::HostNotFound => HttpErrorKind::Connect,
        ureq::Error::Io(cause) => match cause.kind() {
            io::ErrorKind::ConnectionRefused => HttpErrorKind::Connect,
            io::ErrorKind::TimedOut => HttpErrorKind::Timeout,
            _ => HttpErrorKind::Interrupted,
        },
        _ => HttpErrorKind::Unknown,
    };
    HttpError::new(kind, error)
}

/// The bytes of a request, which lie in several places.
struct Chunks(VecDeque<Bytes>);

impl Chunks {
    fn of(mut body: HttpRequestBody) -> Self {
        use http_body::Body as _;
        let mut chunks = VecDeque::new();
        let mut context = Context::from_waker(Waker::noop());
        // These bodies are in memory, so that they never wait.
        while let Poll::Ready(Some(Ok(frame))) = Pin::new(&mut body).poll_frame(&mut context) {
            chunks.extend(frame.into_data());
        }
        Self(chunks)
    }
}

impl Read for Chunks {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        while self.0.front().is_some_and(Bytes::is_empty) {
            self.0.pop_front();
        }
        let Some(first) = self.0.front_mut() else { return Ok(0) };
        let count = first.len().min(to.len());
        first.copy_to_slice(&mut to[..count]);
        Ok(count)
    }
}
