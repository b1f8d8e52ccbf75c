//! Traces for OpenTelemetry: a span for each request, one for its job below it, and one for each stage of the job. A job
//! that another server does has a span of that server in between.
//!
//! They are sent by OTLP over HTTP, in batches, from a thread of their own. The variables of the OpenTelemetry
//! specification set the address, the share of traces that is sent, and the service's name: `OTEL_EXPORTER_OTLP_ENDPOINT`,
//! `OTEL_TRACES_SAMPLER`, `OTEL_SERVICE_NAME` and so on. Without an address, no trace is made.
//!
//! `traces_absent.rs` stands in where the feature `otel` is left out.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};

use opentelemetry::propagation::{Extractor, Injector, TextMapPropagator as _};
use opentelemetry::trace::{
    Span as _, SpanBuilder, SpanKind, Status, TraceContextExt as _, Tracer as _, TracerProvider as _,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_http::{Bytes, HttpClient, HttpError, Request, Response};
use opentelemetry_otlp::{SpanExporter, WithHttpConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{SdkTracer, SdkTracerProvider};
use tracing::Span;
use tracing_opentelemetry::OpenTelemetrySpanExt as _;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::registry::LookupSpan;

/// Time for one batch, and for the last one at the end of the process.
const SEND_TIME: Duration = Duration::from_secs(5);

/// The name of the service and of its spans, in traces.
const NAME: &str = "meshsnap";

/// The variables that name a collector, the more special one first.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

static SENDING: OnceLock<(SdkTracerProvider, SdkTracer)> = OnceLock::new();

/// The place of something in a trace.
#[derive(Clone, Default)]
pub struct Trace(Option<Context>);

impl std::fmt::Debug for Trace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Trace").finish_non_exhaustive()
    }
}

impl Trace {
    /// The place of the span that this thread is in.
    pub fn here() -> Self {
        Self(SENDING.get().map(|_| Span::current().context()))
    }

    /// The place that a client names in its headers (W3C Trace Context), if it names one.
    pub fn of_headers<'h>(header: impl Fn(&str) -> Option<&'h str>) -> Self {
        let headers = || Headers { parent: header("traceparent"), state: header("tracestate") };
        Self(SENDING.get().map(|_| TraceContextPropagator::new().extract(&headers())))
    }

    /// The place as a `traceparent`. None: there is no trace.
    pub fn header(&self) -> Option<String> {
        let mut header = Header(None);
        TraceContextPropagator::new().inject_context(self.0.as_ref()?, &mut header);
        header.0
    }

    /// Puts a new span below this place.
    pub fn adopt(&self, span: &Span) {
        if let Some(context) = &self.0 {
            // A span that no layer listens to has no parent either.
            let _ = span.set_parent(context.clone());
        }
    }
}

/// Notes a request's method and route, under the names of OpenTelemetry's conventions. The span has an empty field `otel.kind`.
pub fn describe_request(span: &Span, method: &str, route: Option<&str>) {
    if SENDING.get().is_none() {
        return;
    }
    span.set_attribute("http.request.method", method.to_owned());
    let name = match route {
        Some(route) => format!("{method} {route}"),
        None => method.to_owned(),
    };
    if let Some(route) = route {
        span.set_attribute("http.route", route.to_owned());
    }
    // Only a field can set the kind, so that the log has it, too.
    span.record("otel.kind", "server");
    span.context().span().update_name(name);
}

/// Notes the status of the answer.
pub fn describe_answer(span: &Span, status: u16) {
    if SENDING.get().is_none() {
        return;
    }
    span.set_attribute("http.response.status_code", i64::from(status));
    if status >= 500 {
        span.set_status(Status::error(""));
    }
}

/// Notes the end of a job.
pub fn describe_end(span: &Span, state: &'static str, has_failed: bool) {
    if SENDING.get().is_none() {
        return;
    }
    span.set_attribute("job.state", state);
    if has_failed {
        span.set_status(Status::error(""));
    }
}

/// A part of a span that is over.
pub fn add_part(span: &Span, name: &'static str, began: Instant, ended: Instant) {
    let Some((_, tracer)) = SENDING.get() else { return };
    let (now, wall) = (Instant::now(), SystemTime::now());
    let at = |instant: Instant| wall - now.saturating_duration_since(instant);
    let part = SpanBuilder::from_name(name).with_kind(SpanKind::Internal).with_start_time(at(began));
    tracer.build_with_context(part, &span.context()).end_with_timestamp(at(ended));
}

/// The layer that makes spans of what the log knows as spans; None if no collector is named.
pub fn layer<S>() -> Result<Option<impl Layer<S>>, String>
where
    S: tracing::Subscriber + for<'span> LookupSpan<'span>,
{
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let is_off = set("OTEL_SDK_DISABLED").is_some_and(|value| value.eq_ignore_ascii_case("true"))
        || set("OTEL_TRACES_EXPORTER").is_some_and(|value| value == "none");
    if is_off || !ENDPOINTS.iter().any(|name| set(name).is_some()) {
        return Ok(None);
    }
    let exporter = SpanExporter::builder().with_http().with_http_client(Collector::new()).build();
    let exporter = exporter.map_err(|error| format!("traces cannot be sent: {error}"))?;
    let mut resource = Resource::builder();
    // The builder takes the variables into account, and a name that is given here would win over them.
    let names_service = |attributes: String| attributes.split(',').any(|pair| pair.trim().starts_with("service.name="));
    if set("OTEL_SERVICE_NAME").is_none() && !set("OTEL_RESOURCE_ATTRIBUTES").is_some_and(names_service) {
        resource = resource.with_service_name(NAME);
    }
    let resource = resource.with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION"))).build();
    let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build();
    let tracer = provider.tracer(NAME);
    let _ = SENDING.set((provider, tracer.clone()));
    let layer = tracing_opentelemetry::layer().with_tracer(tracer).with_location(false).with_threads(false);
    let layer = layer.with_tracked_inactivity(false).with_target(false);
    // Whatever the log shows, a trace is whole. The exporter's own requests are no part of it.
    Ok(Some(layer.with_filter(Targets::new().with_target(NAME, LevelFilter::INFO))))
}

/// Sends what is left. To be called once, at the end of the process.
pub fn finish() {
    if let Some((provider, _)) = SENDING.get()
        && let Err(error) = provider.shutdown_with_timeout(SEND_TIME)
    {
        tracing::warn!(%error, "the last traces were not sent");
    }
}

struct Headers<'h> {
    parent: Option<&'h str>,
    state: Option<&'h str>,
}

/// The header `traceparent`.
struct Header(Option<String>);

impl Injector for Header {
    fn set(&mut self, key: &str, value: String) {
        if key == "traceparent" {
            self.0 = Some(value);
        }
    }
}

impl Extractor for Headers<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        match key {
            "traceparent" => self.parent,
            "tracestate" => self.state,
            _ => None,
        }
    }

    fn keys(&self) -> Vec<&str> {
        vec!["traceparent", "tracestate"]
    }
}

/// The connection to the collector. It blocks the thread that sends batches, and no other.
#[derive(Debug)]
struct Collector {
    agent: ureq::Agent,
    has_failed: AtomicBool,
}

impl Collector {
    fn new() -> Self {
        let config = ureq::Agent::config_builder()
            .timeout_global(Some(SEND_TIME))
            .http_status_as_error(false)
            .user_agent(concat!("meshsnap/", env!("CARGO_PKG_VERSION")))
            .build();
        Self { agent: config.new_agent(), has_failed: AtomicBool::new(false) }
    }

    fn send(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let (parts, body) = request.into_parts();
        let answer = self.agent.run(Request::from_parts(parts, &body[..]))?;
        let (parts, mut body) = answer.into_parts();
        Ok(Response::from_parts(parts, body.read_to_vec()?.into()))
    }
}

#[async_trait::async_trait]
impl HttpClient for Collector {
    async fn send_bytes(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let sent = self.send(request);
        let failure = match &sent {
            Ok(answer) if answer.status().is_success() => None,
            Ok(answer) => Some(format!("it answered {}", answer.status())),
            Err(error) => Some(error.to_string()),
        };
        // Once, and not for each batch.
        match failure {
            Some(why) if !self.has_failed.swap(true, Ordering::Relaxed) => {
                tracing::warn!(why, "the collector does not take traces");
            }
            None if self.has_failed.swap(false, Ordering::Relaxed) => {
                tracing::info!("the collector takes traces again")
            }
            _ => {}
        }
        sent
    }
}
