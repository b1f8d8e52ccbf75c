//! The stand-in for `traces.rs` in builds without the feature `otel`: the same functions, which trace nothing.

use std::time::Instant;

use tracing::Span;
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Identity;

/// No place in a trace.
#[derive(Clone, Debug, Default)]
pub struct Trace;

impl Trace {
    /// No place.
    pub fn here() -> Self {
        Self
    }

    /// No place.
    pub fn of_headers<'h>(_: impl Fn(&str) -> Option<&'h str>) -> Self {
        Self
    }

    /// None.
    pub fn header(&self) -> Option<String> {
        None
    }

    /// Leaves the span where it is.
    pub fn adopt(&self, _: &Span) {}
}

/// Does nothing.
pub fn describe_request(_: &Span, _: &str, _: Option<&str>) {}

/// Does nothing.
pub fn describe_answer(_: &Span, _: u16) {}

/// Does nothing.
pub fn describe_end(_: &Span, _: &'static str, _: bool) {}

/// Does nothing.
pub fn add_part(_: &Span, _: &'static str, _: Instant, _: Instant) {}

/// No layer.
pub fn layer<S: tracing::Subscriber>() -> Result<Option<impl Layer<S>>, String> {
    Ok(None::<Identity>)
}

/// Does nothing.
pub fn finish() {}
