//! The log on standard error: text on a terminal, one JSON object per line elsewhere.

use std::io::IsTerminal as _;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Starts the log. `filter` has the syntax of `tracing`: `info`, or `warn,meshsnap::service=debug`.
/// If `json` is None, the log is JSON unless standard error is a terminal.
pub fn init(filter: &str, json: Option<bool>) -> Result<(), String> {
    let filter = level(filter).ok_or_else(|| {
        format!("is \"{filter}\", which is no level; use off, error, warn, info, debug or trace, or PART=LEVEL")
    })?;
    let mut parsed = EnvFilter::try_new(filter).map_err(|e| {
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
    let terminal = std::io::stderr().is_terminal();
    let text = !json.unwrap_or(!terminal);
    let builder = tracing_subscriber::fmt().with_env_filter(parsed).with_writer(std::io::stderr);
    let started = if text {
        builder.with_ansi(terminal).with_target(false).try_init()
    } else {
        builder.json().flatten_event(true).with_current_span(true).with_span_list(false).try_init()
    };
    started.map_err(|e| e.to_string())?;
    log_panics();
    Ok(())
}

/// A filter in which a single word is a level. `tracing` takes other words for parts of a program,
/// and shows nothing of all others. None for a word that is neither.
fn level(filter: &str) -> Option<&str> {
    const LEVELS: [&str; 6] = ["off", "error", "warn", "info", "debug", "trace"];
    let is_level = |word: &str| LEVELS.iter().any(|level| level.eq_ignore_ascii_case(word));
    match filter.trim() {
        word if word.eq_ignore_ascii_case("warning") => Some("warn"),
        word if is_level(word) || !word.chars().all(char::is_alphabetic) || word == "meshsnap" => Some(word),
        _ => None,
    }
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
    use super::level;

    #[test]
    fn a_single_word_is_a_level() {
        let cases = [
            ("warn", Some("warn")),
            ("WARN", Some("WARN")),
            ("warning", Some("warn")),
            ("Warning", Some("warn")),
            ("0", Some("0")),
            ("meshsnap", Some("meshsnap")),
            ("warn,hyper=debug", Some("warn,hyper=debug")),
            ("verbose", None),
            ("inof", None),
        ];
        for (filter, expected) in cases {
            assert_eq!(level(filter), expected, "{filter}");
        }
    }
}
