//! The settings of `serve`. Each is a flag (secrets have none), an environment variable `MESHSNAP_*` and a key of the
//! TOML file, under one name. A flag overrides a variable, which overrides the file, which overrides the default.
//!
//! A new setting is a field of [`Config`], its default, and one row of [`SETTINGS`].

mod hardware;
mod memory;
mod settings;

use std::path::PathBuf;
use std::sync::LazyLock;

use etcetera::BaseStrategy as _;

pub use hardware::why_no_gpu;
pub use memory::memory_bytes;

use meshsnap_render::limits::Limits;
use meshsnap_render::spec::BackendChoice;
pub use settings::{Access, SETTINGS, Setting};

/// The settings of a process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Config {
    /// Address to listen on.
    pub listen: String,
    /// Folder for jobs, their results, and stored meshes.
    pub data_dir: Option<PathBuf>,
    /// The address of the store that several servers share. None: this one is alone.
    pub store: Option<String>,
    /// Stores nothing in a folder.
    pub ephemeral: bool,
    /// Folder for what makes the next start faster.
    pub cache_dir: Option<PathBuf>,
    /// Number of threads that draw.
    pub workers: u64,
    /// Threads within one CPU render; 0 means that the workers share the cores: a picture that is
    /// drawn alone has all of them.
    pub worker_threads: u64,
    /// The back-end of a request that names none.
    pub backend: BackendChoice,
    /// Bearer tokens of clients. Empty: no client needs one.
    pub api_keys: Vec<String>,
    /// File of named keys.
    pub api_keys_file: Option<PathBuf>,
    /// Time after the signal to end for which work is still taken, while `/readyz` says that it soon will not be, ms.
    pub drain_delay_ms: u64,
    /// The key of signatures of webhooks, as text. None: there are no webhooks.
    pub webhook_secret: Option<String>,
    /// Lets webhooks go to addresses of private networks.
    pub webhooks_to_private: bool,
    /// The certificates by which receivers of webhooks are trusted, in PEM. None: Mozilla's list.
    pub webhooks_ca: Option<PathBuf>,
    /// The pause after the first attempt of a webhook that fails, milliseconds.
    pub webhook_retry_ms: u64,
    /// Allows clients without tokens on addresses other than loopback.
    pub no_auth: bool,
    /// Origins of pages of other sites that may use the interface: [`ANY_ORIGIN`] alone, or some.
    pub cors_origins: Vec<String>,
    /// Most connections at a time.
    pub connections: u64,
    /// Most connections of one address; 0: three quarters of all.
    pub connections_per_address: u64,
    /// Time after which a connection is asked to end, milliseconds.
    pub connection_age_ms: u64,
    /// Least bytes a second by which a client sends a body, and reads an answer that waits for it; 0: any.
    pub least_rate_bytes: u64,
    /// Most requests a second of a key, or of an address where there are no keys; 0: any number.
    pub rate_per_s: u64,
    /// Most of them at once; 0: those of a second.
    pub rate_burst: u64,
    /// Most meshes and jobs of a day; 0: any number.
    pub quota_per_day: u64,
    /// Most bytes of memory for jobs, uploads, stored meshes, caches, results and answers together; 0: by the container or
    /// the machine.
    pub memory_bytes: u64,
    /// Most bytes of uploads in memory at a time.
    pub uploads_bytes: u64,
    /// Longest time for the header of a request, milliseconds; also the longest time that a
    /// connection is idle.
    pub header_timeout_ms: u64,
    /// Longest time for the body of a request, milliseconds.
    pub body_timeout_ms: u64,
    /// Time beyond the limit of a job after which its worker is replaced, milliseconds.
    pub overdue_grace_ms: u64,
    /// Longest time for which a request waits for a worker, as far as is known when it comes, milliseconds.
    pub wait_ms: u64,
    /// The same for a job that is fetched later.
    pub batch_wait_ms: u64,
    /// Time for which the result of a job can be fetched again after the first time, milliseconds.
    pub result_ttl_ms: u64,
    /// Time for which the result of a job waits for being fetched, milliseconds.
    pub unfetched_ttl_ms: u64,
    /// Most bytes of results in memory.
    pub result_bytes: u64,
    /// Most results in memory.
    pub result_count: u64,
    /// Most bytes of stored meshes in memory.
    pub mesh_bytes: u64,
    /// Most stored meshes.
    pub mesh_count: u64,
    /// Most bytes of stored meshes that stay in memory as they are drawn.
    pub resident_bytes: u64,
    /// Most bytes of pictures of stored meshes that stay in memory.
    pub picture_bytes: u64,
    /// Filter of the log, in the syntax of `tracing`.
    pub log: String,
    /// True for a JSON log, false for text. None: text if standard error is a terminal.
    pub log_json: Option<bool>,
    /// The largest request body that is accepted, bytes.
    pub body_bytes: u64,
    /// Wall-clock time for one job, from the moment at which a worker begins it to the encoded image, milliseconds.
    pub job_ms: u64,
    /// The address of a queue of jobs that several servers share. None: this one has a queue of its own.
    pub shared_queue: Option<String>,
    /// Most jobs that wait there.
    pub queue_jobs: u64,
    /// The file of credentials for it.
    pub queue_credentials: Option<PathBuf>,
    /// The file of certificates by which its servers are trusted.
    pub queue_ca: Option<PathBuf>,
    /// Jobs of a class that wait per worker. A full queue refuses a job at once and never blocks.
    pub queue_per_worker: u64,
    /// Limits of what a single job reads and draws.
    pub limits: Limits,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: "127.0.0.1:8080".into(),
            data_dir: None,
            store: None,
            ephemeral: false,
            cache_dir: None,
            workers: cores(),
            worker_threads: 0,
            backend: BackendChoice::Auto,
            api_keys: Vec::new(),
            api_keys_file: None,
            drain_delay_ms: 0,
            webhook_secret: None,
            webhooks_to_private: false,
            webhooks_ca: None,
            webhook_retry_ms: 5000,
            no_auth: false,
            cors_origins: Vec::new(),
            connections: 512,
            connections_per_address: 0,
            connection_age_ms: 3600 * 1000,
            least_rate_bytes: 1024,
            rate_per_s: 0,
            rate_burst: 0,
            quota_per_day: 0,
            memory_bytes: 0,
            uploads_bytes: 1 << 30,
            header_timeout_ms: 10_000,
            body_timeout_ms: 60_000,
            overdue_grace_ms: 30_000,
            wait_ms: 30_000,
            batch_wait_ms: 600_000,
            result_ttl_ms: 600_000,
            unfetched_ttl_ms: 24 * 3600 * 1000,
            result_bytes: 256 << 20,
            result_count: 10_000,
            mesh_bytes: 256 << 20,
            mesh_count: 1000,
            resident_bytes: 512 << 20,
            picture_bytes: 128 << 20,
            log: "info".into(),
            log_json: None,
            body_bytes: 64 << 20,
            job_ms: 30_000,
            queue_per_worker: 64,
            shared_queue: None,
            queue_jobs: 100_000,
            queue_credentials: None,
            queue_ca: None,
            limits: Limits::default(),
        }
    }
}

/// The word for all origins.
pub const ANY_ORIGIN: &str = "*";

/// The folder for data by this platform's convention. None if there is no home folder.
pub fn default_data_dir() -> Option<PathBuf> {
    let folders = etcetera::choose_base_strategy().ok()?;
    Some(folders.data_dir().join("meshsnap"))
}

/// Number of processors that this process may use.
pub fn cores() -> u64 {
    // Linux finds it out by reading files.
    static CORES: LazyLock<u64> = LazyLock::new(|| std::thread::available_parallelism().map_or(1, |n| n.get() as u64));
    *CORES
}

/// A setting that is refused.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// No such key.
    #[error("{source_name} has no setting `{key}`; the settings are {known}")]
    Unknown {
        /// Its source, such as a file or "the command line".
        source_name: String,
        /// The key.
        key: String,
        /// All keys.
        known: String,
    },
    /// A value that is not allowed.
    #[error("`{key}` from {source_name} is \"{value}\", and allowed is {allowed}")]
    Value {
        /// Its source, such as a file or "the command line".
        source_name: String,
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// The values that are allowed.
        allowed: String,
    },
    /// Not TOML, or a table where a value should be.
    #[error("{source_name} cannot be read as a configuration: {detail}")]
    File {
        /// The file.
        source_name: String,
        /// The reason.
        detail: String,
    },
}

impl Config {
    /// Sets one value. `source_name` names its source in errors: "the command line", a file.
    pub fn apply(&mut self, source_name: &str, key: &str, value: &str) -> Result<(), ConfigError> {
        let Some(setting) = SETTINGS.iter().find(|s| s.key == key) else {
            let known = SETTINGS.iter().map(|s| s.key).collect::<Vec<_>>().join(", ");
            return Err(ConfigError::Unknown { source_name: source_name.into(), key: key.into(), known });
        };
        setting.set(self, value).map_err(|allowed| {
            // Messages reach logs, which are no place for secrets.
            let value = if setting.has_flag { value } else { "(not shown)" };
            let (source_name, key, value) = (source_name.into(), key.into(), value.into());
            ConfigError::Value { source_name, key, value, allowed }
        })
    }

    /// Sets all values of a TOML file. Its keys may be written with `-` or `_`.
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

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    #[test]
    fn every_default_is_allowed_and_survives_being_written_and_read() {
        let mut checked = 0;
        // Paths are none by default, which cannot be written.
        let is_path = |key: &str| ["-dir", "-file", "-ca"].iter().any(|end| key.ends_with(end));
        for setting in SETTINGS.iter().filter(|s| s.has_flag && !is_path(s.key)) {
            let (default, mut copy) = (Config::default(), Config::default());
            setting.set(&mut copy, &setting.show(&default)).unwrap_or_else(|e| panic!("{}: {e}", setting.key));
            assert_eq!(copy, default, "{}", setting.key);
            checked += 1;
        }
        assert_eq!(checked, SETTINGS.len() - 8);
    }

    #[test]
    fn every_limit_has_its_flag() {
        // All limits are numbers, so that debug output has `name: number` for each.
        let values = |limits: &Limits| -> BTreeMap<String, String> {
            let text = format!("{limits:?}").replace(['{', '}', ','], "\n");
            let pairs = text.lines().filter_map(|line| line.trim().split_once(": "));
            pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).collect()
        };
        let mut with_flags = BTreeSet::new();
        for setting in SETTINGS.iter().filter(|setting| setting.has_flag) {
            let Some(name) = setting.key.strip_prefix("limit-").map(|key| key.replace('-', "_")) else { continue };
            let mut config = Config::default();
            setting.set(&mut config, "77").unwrap();
            // Those of a body and of a job's time concern the service alone.
            if !["body_bytes", "job_ms"].contains(&name.as_str()) {
                assert_eq!(values(&config.limits)[&name], "77", "{} sets another limit", setting.key);
                with_flags.insert(name);
            }
        }
        assert!(values(&Limits::default()).into_keys().eq(with_flags), "a limit without a flag");
    }

    #[test]
    fn a_file_sets_everything_that_a_flag_does() {
        let mut config = Config::default();
        let text = "listen = \"0.0.0.0:99\"\nworkers = 3\nno_auth = true\nlimit-body-bytes = \"2MiB\"\n\
                    cors-origins = [\"https://A.example\", \"http://localhost:3000\", \"http://[::1]:80\"]\n\
                    api-keys = [\"a\", \"b\"]\nbackend = \"cpu\"\nlog-format = \"json\"\nqueue = 5\n";
        config.apply_toml("test.toml", text).unwrap();
        assert_eq!((config.listen.as_str(), config.workers, config.no_auth), ("0.0.0.0:99", 3, true));
        assert_eq!((config.body_bytes, config.queue_per_worker), (2 << 20, 5));
        assert_eq!(config.api_keys, ["a", "b"]);
        assert_eq!(config.cors_origins, ["https://a.example", "http://localhost:3000", "http://[::1]"]);
        assert_eq!((config.backend, config.log_json), (BackendChoice::Cpu, Some(true)));
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
            ("api-keys = \" , \"", "at least one key"),
            ("api-keys = []", "at least one key"),
            ("api-keys-file = \"\"", "the path of a file"),
            ("cors-origins = \"https://a.example/\"", "https://app.example"),
            ("cors-origins = \"a.example\"", "https://app.example"),
            ("cors-origins = \"null\"", "https://app.example"),
            ("cors-origins = \"https://*.example\"", "https://app.example"),
            ("cors-origins = \"https://a.example:99999\"", "https://app.example"),
            ("cors-origins = \"https://u@a.example\"", "https://app.example"),
            ("cors-origins = [\"*\", \"https://a.example\"]", "* alone"),
            ("listen = ", "cannot be read"),
            ("[limits]", "must be a plain value"),
        ];
        for (text, part) in cases {
            let error = Config::default().apply_toml("x.toml", text).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("x.toml"), "{text}: {error}");
        }
    }
}
