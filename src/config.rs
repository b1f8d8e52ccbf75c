//! What `serve` can be told, as a table: every setting is a flag, an environment variable `MESHSNAP_*` and a key of the
//! TOML file, under one name. Flag beats variable beats file beats default.
//!
//! A new setting is a field of [`Config`], its default, and a line in [`SETTINGS`].

mod hardware;

use std::path::PathBuf;

pub use hardware::why_no_gpu;

use crate::limits::{BackendChoice, Limits};
use crate::request::{IMAGE_PX_MAX, Words, word_for, words_of};

/// The settings of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Address to listen on.
    pub listen: String,
    /// Where meshes and results will be stored by a version that stores any.
    pub data_dir: Option<PathBuf>,
    /// Threads that draw.
    pub workers: u64,
    /// Threads within one CPU render; 0 means the cores divided by the workers.
    pub worker_threads: u64,
    /// The back-end of a request that names none.
    pub backend: BackendChoice,
    /// Bearer tokens of clients; empty: everybody.
    pub api_keys: Vec<String>,
    /// Serve everybody even beyond loopback.
    pub no_auth: bool,
    /// Connections at once.
    pub connections: u64,
    /// Uploads in memory at once, bytes.
    pub uploads_bytes: u64,
    /// For the header of a request, milliseconds; also how long an idle connection is kept.
    pub header_timeout_ms: u64,
    /// For the body of a request, milliseconds.
    pub body_timeout_ms: u64,
    /// How long results of jobs can be fetched, milliseconds.
    pub result_ttl_ms: u64,
    /// Results of jobs in memory, bytes.
    pub result_bytes: u64,
    /// Results of jobs in memory.
    pub result_count: u64,
    /// What is logged, in `tracing` filter syntax.
    pub log: String,
    /// How it is logged.
    pub log_format: LogFormat,
    /// What a job may use.
    pub limits: Limits,
}

/// Form of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogFormat {
    /// Text on a terminal, JSON elsewhere.
    Auto,
    /// For people.
    Text,
    /// For machines: an object a line.
    Json,
}

impl Words for LogFormat {
    const NOW: &'static [(&'static str, Self)] = &[("auto", Self::Auto), ("text", Self::Text), ("json", Self::Json)];
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: "127.0.0.1:8080".into(),
            data_dir: None,
            workers: cores(),
            worker_threads: 0,
            backend: BackendChoice::Auto,
            api_keys: Vec::new(),
            no_auth: false,
            connections: 512,
            uploads_bytes: 1 << 30,
            header_timeout_ms: 10_000,
            body_timeout_ms: 60_000,
            result_ttl_ms: 600_000,
            result_bytes: 256 << 20,
            result_count: 10_000,
            log: "info".into(),
            log_format: LogFormat::Auto,
            limits: Limits::default(),
        }
    }
}

/// Processors that this process may use.
pub fn cores() -> u64 {
    std::thread::available_parallelism().map_or(1, |n| n.get() as u64)
}

/// A setting's place in the configuration, and how its text is read and written.
#[derive(Clone, Copy)]
pub enum Access {
    /// A whole number in a closed range.
    Number(u64, u64, fn(&mut Config) -> &mut u64),
    /// On or off.
    Switch(fn(&mut Config) -> &mut bool),
    /// Anything else: how to set it, and how to show it.
    Text(fn(&mut Config, &str) -> Result<(), String>, fn(&Config) -> String),
}

/// One setting.
pub struct Setting {
    /// Kebab case, as in the flag.
    pub key: &'static str,
    /// One sentence.
    pub help: &'static str,
    /// Where and how.
    pub access: Access,
    /// Whether there is a flag: secrets have none, because every user of the machine can read a command line.
    pub has_flag: bool,
}

/// Longest time that can be set: a day, so that no sum of times overflows.
const MS_MAX: u64 = 24 * 3600 * 1000;

/// Every setting.
pub const SETTINGS: &[Setting] = &[
    text("listen", "Address and port to listen on", |c, v| set(&mut c.listen, v), |c| c.listen.clone()),
    text("data-dir", "Where meshes and results are stored (this version keeps them in memory)", set_data_dir, data_dir),
    number("workers", "Threads that draw", 1, 1024, |c| &mut c.workers),
    number("worker-threads", "Threads within one CPU render; 0: cores / workers", 0, 1024, |c| &mut c.worker_threads),
    number("queue", "Jobs that may wait for each worker", 0, 1 << 20, |c| &mut c.limits.queue_per_worker),
    text("backend", "Who draws unless a request says: auto, gpu or cpu", set_backend, |c| word_for(c.backend).into()),
    secret("api-keys", "Bearer tokens of clients, separated by commas", set_api_keys),
    switch("no-auth", "Serve without keys even beyond loopback", |c| &mut c.no_auth),
    number("connections", "Connections at once", 1, 1 << 20, |c| &mut c.connections),
    number("uploads-bytes", "Uploads in memory at once", 1, u64::MAX, |c| &mut c.uploads_bytes),
    number("header-timeout-ms", "Time for a request's header", 1, MS_MAX, |c| &mut c.header_timeout_ms),
    number("body-timeout-ms", "Time for a request's body", 1, MS_MAX, |c| &mut c.body_timeout_ms),
    number("result-ttl-ms", "How long a job's result is kept", 0, MS_MAX, |c| &mut c.result_ttl_ms),
    number("result-bytes", "Memory for results of jobs", 0, u64::MAX, |c| &mut c.result_bytes),
    number("result-count", "Results of jobs in memory", 1, 1 << 24, |c| &mut c.result_count),
    text(
        "log",
        "What is logged: error, warn, info, debug, or a tracing filter",
        |c, v| set(&mut c.log, v),
        |c| c.log.clone(),
    ),
    text("log-format", "auto, text or json", set_log_format, |c| word_for(c.log_format).into()),
    number("limit-body-bytes", "Largest request body", 1, u64::MAX, |c| &mut c.limits.body_bytes),
    number("limit-memory-bytes", "Memory for one job", 1, u64::MAX, |c| &mut c.limits.memory_bytes),
    number("limit-triangles", "Triangles of one mesh", 1, u64::MAX, |c| &mut c.limits.triangles),
    number("limit-nodes", "Nodes of one scene graph", 1, u64::MAX, |c| &mut c.limits.nodes),
    // 128 is where the JSON parser itself stops.
    number("limit-json-depth", "Nesting of JSON", 1, 128, |c| &mut c.limits.json_depth),
    number("limit-image-px", "Width and height of a picture", 1, IMAGE_PX_MAX, |c| &mut c.limits.image_px),
    number("limit-job-ms", "Time for one job, waiting included", 1, MS_MAX, |c| &mut c.limits.job_ms),
    number("limit-queue-per-worker", "The same as --queue", 0, 1 << 20, |c| &mut c.limits.queue_per_worker),
];

impl Setting {
    /// The environment variable.
    pub fn variable(&self) -> String {
        format!("MESHSNAP_{}", self.key.to_ascii_uppercase().replace('-', "_"))
    }

    /// Reads `value` into `config`, or says what is allowed.
    pub fn set(&self, config: &mut Config, value: &str) -> Result<(), String> {
        match self.access {
            Access::Number(min, max, at) => {
                let number = parse_number(value).filter(|n| (min..=max).contains(n));
                *at(config) = number.ok_or_else(|| format!("a whole number from {min} to {max}"))?;
                Ok(())
            }
            Access::Switch(at) => {
                *at(config) = value.parse().map_err(|_| "true or false".to_owned())?;
                Ok(())
            }
            Access::Text(set, _) => set(config, value),
        }
    }

    /// The value in `config`, as text.
    pub fn show(&self, config: &Config) -> String {
        let mut copy = config.clone();
        match self.access {
            Access::Number(_, _, at) => at(&mut copy).to_string(),
            Access::Switch(at) => at(&mut copy).to_string(),
            Access::Text(_, get) => get(config),
        }
    }
}

/// A setting that cannot be.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// No such key.
    #[error("{source_name} has no setting `{key}`; the settings are {known}")]
    Unknown {
        /// Where it was found.
        source_name: String,
        /// The key.
        key: String,
        /// All keys.
        known: String,
    },
    /// A value that is not allowed.
    #[error("`{key}` from {source_name} is \"{value}\", and allowed is {allowed}")]
    Value {
        /// Where it was found.
        source_name: String,
        /// The key.
        key: String,
        /// What was given.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// Not TOML, or a table where a value should be.
    #[error("{source_name} cannot be read as a configuration: {detail}")]
    File {
        /// Which file.
        source_name: String,
        /// Why.
        detail: String,
    },
}

impl Config {
    /// Applies one value; `source_name` says where it comes from ("the command line", a file name ...).
    pub fn apply(&mut self, source_name: &str, key: &str, value: &str) -> Result<(), ConfigError> {
        let Some(setting) = SETTINGS.iter().find(|s| s.key == key) else {
            let known = SETTINGS.iter().map(|s| s.key).collect::<Vec<_>>().join(", ");
            return Err(ConfigError::Unknown { source_name: source_name.into(), key: key.into(), known });
        };
        setting.set(self, value).map_err(|allowed| {
            let (source_name, key, value) = (source_name.into(), key.into(), value.into());
            ConfigError::Value { source_name, key, value, allowed }
        })
    }

    /// Applies a TOML file's text. Keys may be written with `-` or `_`.
    pub fn apply_toml(&mut self, source_name: &str, text: &str) -> Result<(), ConfigError> {
        let file_error = |detail: String| ConfigError::File { source_name: source_name.into(), detail };
        let table: toml::Table = text.parse().map_err(|e: toml::de::Error| file_error(e.to_string()))?;
        for (key, value) in table {
            let value = toml_text(&value).ok_or_else(|| file_error(format!("`{key}` must be a plain value")))?;
            self.apply(source_name, &key.replace('_', "-"), &value)?;
        }
        Ok(())
    }
}

fn toml_text(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(number) => Some(number.to_string()),
        toml::Value::Boolean(on) => Some(on.to_string()),
        toml::Value::Array(list) => Some(list.iter().map(toml_text).collect::<Option<Vec<_>>>()?.join(",")),
        _ => None,
    }
}

/// `1000`, `1_000` or `64MiB`.
fn parse_number(text: &str) -> Option<u64> {
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30)];
    let unit = units.iter().find_map(|&(name, shift)| text.strip_suffix(name).map(|rest| (rest.trim_end(), shift)));
    let (digits, shift) = unit.unwrap_or((text, 0));
    digits.replace('_', "").parse::<u64>().ok()?.checked_mul(1 << shift)
}

fn set(place: &mut String, value: &str) -> Result<(), String> {
    if value.is_empty() {
        return Err("some text".into());
    }
    value.clone_into(place);
    Ok(())
}

fn set_data_dir(config: &mut Config, value: &str) -> Result<(), String> {
    config.data_dir = Some(value.into());
    Ok(())
}

fn data_dir(config: &Config) -> String {
    config.data_dir.as_ref().map(|d| d.display().to_string()).unwrap_or_default()
}

fn set_word<T: Words>(place: &mut T, value: &str) -> Result<(), String> {
    let found = T::NOW.iter().find(|&&(word, _)| word == value);
    *place = found.map(|&(_, v)| v).ok_or_else(|| format!("one of {}", words_of::<T>().join(", ")))?;
    Ok(())
}

fn set_backend(config: &mut Config, value: &str) -> Result<(), String> {
    set_word(&mut config.backend, value)
}

fn set_log_format(config: &mut Config, value: &str) -> Result<(), String> {
    set_word(&mut config.log_format, value)
}

fn set_api_keys(config: &mut Config, value: &str) -> Result<(), String> {
    config.api_keys = value.split(',').map(str::trim).filter(|k| !k.is_empty()).map(str::to_owned).collect();
    Ok(())
}

const fn number(key: &'static str, help: &'static str, min: u64, max: u64, at: fn(&mut Config) -> &mut u64) -> Setting {
    Setting { key, help, access: Access::Number(min, max, at), has_flag: true }
}

const fn switch(key: &'static str, help: &'static str, at: fn(&mut Config) -> &mut bool) -> Setting {
    Setting { key, help, access: Access::Switch(at), has_flag: true }
}

const fn text(
    key: &'static str,
    help: &'static str,
    set: fn(&mut Config, &str) -> Result<(), String>,
    get: fn(&Config) -> String,
) -> Setting {
    Setting { key, help, access: Access::Text(set, get), has_flag: true }
}

const fn secret(key: &'static str, help: &'static str, set: fn(&mut Config, &str) -> Result<(), String>) -> Setting {
    Setting { key, help, access: Access::Text(set, |c| format!("{} keys", c.api_keys.len())), has_flag: false }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_is_allowed_and_survives_being_written_and_read() {
        let mut checked = 0;
        for setting in SETTINGS.iter().filter(|s| s.has_flag && s.key != "data-dir") {
            let (default, mut copy) = (Config::default(), Config::default());
            setting.set(&mut copy, &setting.show(&default)).unwrap_or_else(|e| panic!("{}: {e}", setting.key));
            assert_eq!(copy, default, "{}", setting.key);
            checked += 1;
        }
        assert_eq!(checked, SETTINGS.len() - 2);
    }

    #[test]
    fn every_limit_has_its_flag() {
        let count = SETTINGS.iter().filter(|s| s.key.starts_with("limit-")).count();
        let Limits {
            body_bytes: _,
            memory_bytes: _,
            triangles: _,
            nodes: _,
            json_depth: _,
            image_px: _,
            job_ms: _,
            queue_per_worker: _,
        } = Limits::default();
        assert_eq!(count, 8, "a limit without a flag, or a flag without a limit");
    }

    #[test]
    fn a_file_sets_everything_that_a_flag_does() {
        let mut config = Config::default();
        let text = "listen = \"0.0.0.0:99\"\nworkers = 3\nno_auth = true\nlimit-body-bytes = \"2MiB\"\n\
                    api-keys = [\"a\", \"b\"]\nbackend = \"cpu\"\nlog-format = \"json\"\nqueue = 5\n";
        config.apply_toml("test.toml", text).unwrap();
        assert_eq!((config.listen.as_str(), config.workers, config.no_auth), ("0.0.0.0:99", 3, true));
        assert_eq!((config.limits.body_bytes, config.limits.queue_per_worker), (2 << 20, 5));
        assert_eq!(config.api_keys, ["a", "b"]);
        assert_eq!((config.backend, config.log_format), (BackendChoice::Cpu, LogFormat::Json));
    }

    #[test]
    fn mistakes_are_named() {
        let cases = [
            ("worker = 3", "no setting `worker`"),
            ("workers = 0", "from 1 to 1024"),
            ("workers = -1", "from 1 to 1024"),
            ("workers = 1.5", "must be a plain value"),
            ("backend = \"cuda\"", "auto, gpu, cpu"),
            ("limit-image-px = 8192", "from 1 to 4096"),
            ("limit-body-bytes = \"99999999999GiB\"", "whole number"),
            ("no-auth = \"maybe\"", "true or false"),
            ("listen = ", "cannot be read"),
            ("[limits]", "must be a plain value"),
        ];
        for (text, part) in cases {
            let error = Config::default().apply_toml("x.toml", text).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("x.toml"), "{text}: {error}");
        }
    }
}
