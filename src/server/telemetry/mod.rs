//! The log on standard error: by default, text on a terminal and one JSON object per line elsewhere. With the feature
//! `otel`, [`traces`] for OpenTelemetry as well.

#[cfg_attr(not(feature = "otel"), path = "traces_absent.rs")]
pub mod traces;

use std::io::IsTerminal as _;

use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::layer::{Layer as _, SubscriberExt as _};
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, fmt, registry};

/// Starts the log. `filter` has the syntax of `tracing`: `info`, or `warn,crate=debug`.
/// If `json` is None, the log is JSON unless standard error is a terminal.
pub fn init(filter: &str, json: Option<bool>) -> Result<(), String> {
    let words = with_usual_words(filter);
    if !is_known(&words) {
        return Err(format!(
            "is \"{filter}\", which is no level; use off, error, warn, info, debug or trace, or PART=LEVEL"
        ));
    }
    let mut parsed = EnvFilter::try_new(words).map_err(|e| {
        format!("is \"{filter}\", which is no filter ({e}); use off, error, warn, info, debug or trace")
    })?;
    // On each start wgpu warns that memory which both sides reach may be slow. What it is used for here is faster:
    // docs/gpu-notes.md has the figures.
    if let (false, true, Ok(quiet)) = (
        filter.contains("wgpu"),
        parsed.max_level_hint() > Some(LevelFilter::ERROR),
        "wgpu_core::instance=error".parse(),
    ) {
        parsed = parsed.add_directive(quiet);
    }
    // What the client of NATS says of its connection, `shared_queue` says once.
    if let (false, Ok(quiet)) = (filter.contains("async_nats"), "async_nats=off".parse()) {
        parsed = parsed.add_directive(quiet);
    }
    let terminal = std::io::stderr().is_terminal();
    let text = !json.unwrap_or(!terminal);
    let lines = fmt::layer().with_writer(std::io::stderr);
    let log = if text {
        lines.with_ansi(terminal).with_target(false).boxed()
    } else {
        lines.json().flatten_event(true).with_current_span(true).with_span_list(false).boxed()
    };
    // Each has a filter of its own: a quiet log makes no holes in traces.
    let started = registry().with(log.with_filter(parsed)).with(traces::layer()?).try_init();
    started.map_err(|e| e.to_string())?;
    log_panics();
    Ok(())
}

/// True unless a filter is a single word that is no level. `tracing` takes such a word for a part of a program,
/// and shows nothing of all others.
fn is_known(filter: &str) -> bool {
    const LEVELS: [&str; 6] = ["off", "error", "warn", "info", "debug", "trace"];
    let word = filter.trim();
    let is_level = LEVELS.iter().any(|level| level.eq_ignore_ascii_case(word));
    is_level || !word.chars().all(char::is_alphabetic) || word == "meshsnap"
}

/// The filter with the levels under the names that `tracing` knows.
fn with_usual_words(filter: &str) -> String {
    let level = |word: &str| match word.trim().to_ascii_lowercase().as_str() {
        "warning" => "warn".to_owned(),
        "err" | "critical" | "fatal" => "error".to_owned(),
        "information" | "notice" => "info".to_owned(),
        _ => word.to_owned(),
    };
    let directive = |directive: &str| match directive.rsplit_once('=') {
        Some((target, word)) => format!("{target}={}", level(word)),
        None => level(directive),
    };
    filter.split(',').map(directive).collect::<Vec<_>>().join(",")
}

/// Sends panic messages to the log, in the log's format. The panics themselves are caught where
/// jobs run.
fn log_panics() {
    std::panic::set_hook(Box::new(|info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let message = info.payload_as_str().unwrap_or("a panic without a message");
        let thread = std::thread::current().name().unwrap_or("unnamed").to_owned();
        tracing::error!(place, thread, "panic: {message}");
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_word_is_a_level() {
        for filter in ["warn", "WARN", "off", "0", "meshsnap", "warn,hyper=debug"] {
            assert!(is_known(filter), "{filter}");
        }
        for filter in ["verbose", "inof"] {
            assert!(!is_known(filter), "{filter}");
        }
    }

    #[test]
    fn levels_have_the_names_that_other_programs_use() {
        let cases = [
            ("warning", "warn"),
            ("WARNING", "warn"),
            ("info", "info"),
            ("warning,hyper=debug", "warn,hyper=debug"),
            ("error,hyper=warning", "error,hyper=warn"),
        ];
        for (given, expected) in cases {
            assert_eq!(with_usual_words(given), expected);
            let filter = EnvFilter::try_new(expected).unwrap();
            assert!(filter.max_level_hint() > Some(LevelFilter::OFF), "{expected}");
        }
    }
}
