//! The table of settings: one row for each, with its key, its help, the values it allows and the field of `Config`
//! that it sets.

use std::path::PathBuf;

use super::Config;
use meshsnap_render::limits::{IMAGE_PX_MAX, JOB_MS_MAX};
use meshsnap_render::spec::BackendChoice;
use meshsnap_render::spec::words::{Words as _, word_for};

/// The type of a setting, and access to its field of [`Config`].
#[derive(Clone, Copy)]
pub enum Access {
    /// A whole number between two bounds, which are allowed too.
    Number(u64, u64, fn(&mut Config) -> &mut u64),
    /// On or off.
    Switch(fn(&mut Config) -> &mut bool),
    /// Any other type: a function that sets it, and one that writes it.
    Text(fn(&mut Config, &str) -> Result<(), String>, fn(&Config) -> String),
}

/// One setting.
pub struct Setting {
    /// The name of the flag, without its hyphens in front.
    pub key: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// The type, and the field.
    pub access: Access,
    /// True if there is a flag. Secrets have none, because every user of the machine can read
    /// command lines.
    pub has_flag: bool,
}

/// Longest time of any setting, milliseconds.
const MS_MAX: u64 = JOB_MS_MAX;

/// The largest number of jobs that wait for each worker.
const QUEUE_MAX: u64 = 1 << 20;

/// The largest rate of requests.
const RATE_MAX: u64 = 1_000_000;

/// The largest side of a JPEG.
const TEXTURE_PX_MAX: u64 = 65_535;

/// Every setting.
pub const SETTINGS: &[Setting] = &[
    text("listen", "Address and port to listen on", set_listen, |c| c.listen.clone()),
    text(
        "data-dir",
        "Folder for jobs, results and stored meshes; by default, one by the platform's convention",
        |c, v| set_folder(&mut c.data_dir, v),
        |c| show_folder(&c.data_dir),
    ),
    text(
        "store",
        "Store of meshes and pictures that several servers share: s3://BUCKET/PREFIX, or file:///FOLDER",
        set_store,
        |c| c.store.clone().unwrap_or_default(),
    ),
    switch("ephemeral", "Store nothing: jobs and meshes end with the process", |c| &mut c.ephemeral),
    text(
        "cache-dir",
        "Folder for what the GPU's driver makes of shaders, so that the next start is faster",
        |c, v| set_folder(&mut c.cache_dir, v),
        |c| show_folder(&c.cache_dir),
    ),
    number("workers", "Number of threads that draw", 1, 1024, |c| &mut c.workers),
    number("worker-threads", "Threads within one CPU render; 0: the workers share the cores", 0, 1024, |c| {
        &mut c.worker_threads
    }),
    text(
        "queue",
        "Most jobs of a class that wait for each worker; or nats://HOST:PORT/NAME, a queue that servers share (with --store)",
        set_queue,
        |c| c.shared_queue.clone().unwrap_or_else(|| c.queue_per_worker.to_string()),
    ),
    number("queue-jobs", "Most jobs that wait in a queue that servers share", 1, 1 << 30, |c| &mut c.queue_jobs),
    text(
        "queue-credentials-file",
        "File of credentials (.creds) for a queue that servers share",
        |c, v| set_file(&mut c.queue_credentials, v),
        |c| show_folder(&c.queue_credentials),
    ),
    text(
        "queue-ca",
        "File of certificates in PEM by which the servers of a shared queue are trusted, beside the system's",
        |c, v| set_file(&mut c.queue_ca, v),
        |c| show_folder(&c.queue_ca),
    ),
    text("backend", "Back-end of requests that name none: auto, gpu or cpu", set_backend, |c| {
        word_for(c.backend).into()
    }),
    secret("api-keys", "Bearer tokens of clients, separated by commas", set_api_keys),
    text(
        "api-keys-file",
        "File of named keys as SHA-256 digests, with scopes; read again on SIGHUP",
        |c, v| set_file(&mut c.api_keys_file, v),
        |c| show_folder(&c.api_keys_file),
    ),
    Setting {
        key: "webhook-secret",
        help: "Key of signatures of webhooks: whsec_ and 24 to 64 bytes in base64; without it there are none",
        access: Access::Text(set_webhook_secret, |_| "a secret".into()),
        has_flag: false,
    },
    switch("webhooks-to-private", "Let webhooks go to addresses of private networks", |c| &mut c.webhooks_to_private),
    text(
        "webhooks-ca",
        "File of certificates in PEM by which receivers of webhooks are trusted, instead of Mozilla's list",
        |c, v| set_file(&mut c.webhooks_ca, v),
        |c| show_folder(&c.webhooks_ca),
    ),
    number(
        "webhook-retry-ms",
        "Pause after the first attempt of a webhook that fails; then four times as long",
        1,
        MS_MAX,
        |c| &mut c.webhook_retry_ms,
    ),
    switch("no-auth", "Allow clients without tokens on addresses other than loopback", |c| &mut c.no_auth),
    text(
        "cors-origins",
        "Origins of pages of other sites that may use the interface, separated by commas, or *",
        set_cors_origins,
        |c| c.cors_origins.join(","),
    ),
    number("connections", "Most connections at a time", 1, 1 << 20, |c| &mut c.connections),
    number("connections-per-address", "Most of them from one address; 0: three quarters", 0, 1 << 20, |c| {
        &mut c.connections_per_address
    }),
    number("connection-age-ms", "Time after which a connection is asked to end", 1, MS_MAX, |c| {
        &mut c.connection_age_ms
    }),
    number(
        "least-rate-bytes",
        "Fewest bytes a second of a body, and of an answer that waits; 0: any",
        0,
        1 << 30,
        |c| &mut c.least_rate_bytes,
    ),
    number("rate-per-s", "Most requests a second of a key, or of an address without keys; 0: any", 0, RATE_MAX, |c| {
        &mut c.rate_per_s
    }),
    number("rate-burst", "Most of them at once; 0: as many as in a second", 0, RATE_MAX, |c| &mut c.rate_burst),
    number("quota-per-day", "Most POSTs and PUTs a day of a key, or of an address; 0: any", 0, RATE_MAX, |c| {
        &mut c.quota_per_day
    }),
    number(
        "memory-bytes",
        "Most bytes of memory for all work and all that is kept; 0: by the machine",
        0,
        u64::MAX,
        |c| &mut c.memory_bytes,
    ),
    number("uploads-bytes", "Most bytes of uploads in memory at a time", 1, u64::MAX, |c| &mut c.uploads_bytes),
    number("header-timeout-ms", "Longest time for the header of a request", 1, MS_MAX, |c| &mut c.header_timeout_ms),
    number("body-timeout-ms", "Longest time for the body of a request", 1, MS_MAX, |c| &mut c.body_timeout_ms),
    number("overdue-grace-ms", "Time beyond limit-job-ms after which a job's worker is replaced", 1, MS_MAX, |c| {
        &mut c.overdue_grace_ms
    }),
    number("drain-delay-ms", "Time after the signal to end for which work is still taken", 0, MS_MAX, |c| {
        &mut c.drain_delay_ms
    }),
    number("wait-ms", "Longest time for which a request is let wait for a worker", 0, MS_MAX, |c| &mut c.wait_ms),
    number("batch-wait-ms", "The same for a job that is fetched later", 0, MS_MAX, |c| &mut c.batch_wait_ms),
    number("result-ttl-ms", "Time for which a result is kept after it was fetched", 0, MS_MAX, |c| {
        &mut c.result_ttl_ms
    }),
    number("unfetched-ttl-ms", "Time for which a result waits for being fetched", 0, MS_MAX, |c| {
        &mut c.unfetched_ttl_ms
    }),
    number("result-bytes", "Most bytes of results in memory", 0, u64::MAX, |c| &mut c.result_bytes),
    number("result-count", "Most results in memory", 1, 1 << 24, |c| &mut c.result_count),
    number("mesh-bytes", "Most bytes of stored meshes in memory", 0, u64::MAX, |c| &mut c.mesh_bytes),
    number("mesh-count", "Most stored meshes; the least recently used is dropped first", 1, 1 << 20, |c| {
        &mut c.mesh_count
    }),
    number("resident-bytes", "Most bytes of stored meshes kept as they are drawn", 0, u64::MAX, |c| {
        &mut c.resident_bytes
    }),
    number("picture-bytes", "Most bytes of drawn pictures of stored meshes", 0, u64::MAX, |c| &mut c.picture_bytes),
    text(
        "log",
        "Filter of the log: error, warn, info, debug, or the syntax of tracing",
        |c, v| set(&mut c.log, v),
        |c| c.log.clone(),
    ),
    text("log-format", "Format of the log: auto, text or json", set_log_format, |c| word(LOG_FORMATS, c.log_json)),
    number("limit-body-bytes", "Largest request body", 1, u64::MAX, |c| &mut c.body_bytes),
    number("limit-memory-bytes", "Most bytes of memory for one job", 1, u64::MAX, |c| &mut c.limits.memory_bytes),
    number("limit-triangles", "Most triangles of one mesh", 1, u64::MAX, |c| &mut c.limits.triangles),
    number("limit-nodes", "Most nodes of one scene graph", 1, u64::MAX, |c| &mut c.limits.nodes),
    // The JSON parser itself stops at 128.
    number("limit-json-depth", "Deepest nesting of JSON", 1, 128, |c| &mut c.limits.json_depth),
    number("limit-image-px", "Largest width and height of a picture", 1, IMAGE_PX_MAX, |c| &mut c.limits.image_px),
    number("limit-texture-px", "Largest width and height of a texture", 1, TEXTURE_PX_MAX, |c| {
        &mut c.limits.texture_px
    }),
    number("limit-texture-total-px", "Most pixels of all textures of one picture", 1, u64::MAX, |c| {
        &mut c.limits.texture_total_px
    }),
    number("limit-bundle-bytes", "Most bytes of a bundle, unpacked", 1, u64::MAX, |c| &mut c.limits.bundle_bytes),
    number("limit-bundle-entries", "Most files of a bundle", 1, 1 << 16, |c| &mut c.limits.bundle_entries),
    number("limit-job-ms", "Longest time for one job, once a worker has begun it", 1, MS_MAX, |c| &mut c.job_ms),
];

impl Setting {
    /// The name of the environment variable.
    pub fn variable(&self) -> String {
        format!("MESHSNAP_{}", self.key.to_ascii_uppercase().replace('-', "_"))
    }

    /// True if an empty variable is the same as none: compose files write one for what is not set. Of keys, it is an error,
    /// because without keys the server is open.
    pub fn may_be_empty(&self) -> bool {
        !self.key.starts_with("api-keys")
    }

    /// Sets `value` in `config`. The error is the allowed values, in words.
    pub fn set(&self, config: &mut Config, value: &str) -> Result<(), String> {
        match self.access {
            Access::Number(min, max, at) => {
                let units = self.units();
                let number = parse_number(value, units).filter(|n| (min..=max).contains(n));
                let example =
                    units.last().map_or(String::new(), |(name, _)| format!(", with a unit if you like: 2{name}"));
                *at(config) = number.ok_or_else(|| format!("a whole number from {min} to {max}{example}"))?;
                Ok(())
            }
            Access::Switch(at) => {
                *at(config) = parse_switch(value).ok_or_else(|| "true or false, yes or no, 1 or 0".to_owned())?;
                Ok(())
            }
            Access::Text(set, _) => set(config, value),
        }
    }

    /// The units in which its number can be given, and what they are worth.
    fn units(&self) -> &'static [(&'static str, u64)] {
        match self.key {
            key if key.ends_with("-ms") => TIME_UNITS,
            key if key.ends_with("-bytes") => SIZE_UNITS,
            _ => &[],
        }
    }

    /// The value in `config` as text.
    pub fn show(&self, config: &Config) -> String {
        let mut copy = config.clone();
        match self.access {
            Access::Number(_, _, at) => at(&mut copy).to_string(),
            Access::Switch(at) => at(&mut copy).to_string(),
            Access::Text(_, get) => get(config),
        }
    }
}

/// The words of `log-format` and their values of [`Config::log_json`].
const LOG_FORMATS: &[(&str, Option<bool>)] = &[("auto", None), ("text", Some(false)), ("json", Some(true))];

/// Units of times in milliseconds. Units that end in others come first.
const TIME_UNITS: &[(&str, u64)] = &[("ms", 1), ("h", 3_600_000), ("m", 60_000), ("s", 1000)];

/// Units of sizes in bytes.
const SIZE_UNITS: &[(&str, u64)] = &[("KiB", 1 << 10), ("GiB", 1 << 30), ("MiB", 1 << 20)];

/// Reads `1000`, `1_000`, `64MiB` or `30 s`.
fn parse_number(text: &str, units: &[(&str, u64)]) -> Option<u64> {
    let unit = units.iter().find_map(|&(name, worth)| text.strip_suffix(name).map(|rest| (rest.trim_end(), worth)));
    let (digits, worth) = unit.unwrap_or((text, 1));
    digits.replace('_', "").parse::<u64>().ok()?.checked_mul(worth)
}

/// Reads a word for on or off.
fn parse_switch(text: &str) -> Option<bool> {
    match text.to_ascii_lowercase().as_str() {
        "true" | "yes" | "1" => Some(true),
        "false" | "no" | "0" => Some(false),
        _ => None,
    }
}

fn set(place: &mut String, value: &str) -> Result<(), String> {
    if value.is_empty() {
        return Err("some text".into());
    }
    value.clone_into(place);
    Ok(())
}

/// Sets an address with a port. One part alone is refused: it is unclear who may reach the server.
fn set_listen(config: &mut Config, value: &str) -> Result<(), String> {
    let (host, port) = value.rsplit_once(':').unwrap_or(("", value));
    let port = port.parse::<u16>();
    if host.is_empty() || port.is_err() {
        let port = port.unwrap_or(8080);
        return Err(format!(
            "an address and a port, such as 127.0.0.1:{port} for this machine alone or 0.0.0.0:{port} for others too"
        ));
    }
    set(&mut config.listen, value)
}

fn set_queue(config: &mut Config, value: &str) -> Result<(), String> {
    if value.contains("://") {
        config.shared_queue = Some(value.to_owned());
        return Ok(());
    }
    let number = value.parse().ok().filter(|number| *number <= QUEUE_MAX);
    config.queue_per_worker =
        number.ok_or_else(|| format!("a whole number from 0 to {QUEUE_MAX}, or an address: nats://HOST:PORT/NAME"))?;
    Ok(())
}

fn set_store(config: &mut Config, value: &str) -> Result<(), String> {
    config.store = Some(value.to_owned()).filter(|address| !address.is_empty());
    Ok(())
}

fn set_folder(place: &mut Option<PathBuf>, value: &str) -> Result<(), String> {
    *place = Some(value.into());
    Ok(())
}

fn show_folder(folder: &Option<PathBuf>) -> String {
    folder.as_ref().map(|folder| folder.display().to_string()).unwrap_or_default()
}

fn set_word<T: Copy>(place: &mut T, words: &[(&str, T)], value: &str) -> Result<(), String> {
    let allowed = || format!("one of {}", words.iter().map(|&(word, _)| word).collect::<Vec<_>>().join(", "));
    *place = words.iter().find(|&&(word, _)| word == value).map(|&(_, v)| v).ok_or_else(allowed)?;
    Ok(())
}

fn word<T: Copy + PartialEq>(words: &[(&str, T)], value: T) -> String {
    words.iter().find(|&&(_, v)| v == value).map_or(String::new(), |&(word, _)| word.to_owned())
}

fn set_backend(config: &mut Config, value: &str) -> Result<(), String> {
    set_word(&mut config.backend, BackendChoice::ALL, value)
}

fn set_log_format(config: &mut Config, value: &str) -> Result<(), String> {
    set_word(&mut config.log_json, LOG_FORMATS, value)
}

fn set_api_keys(config: &mut Config, value: &str) -> Result<(), String> {
    config.api_keys = value.split(',').map(str::trim).filter(|k| !k.is_empty()).map(str::to_owned).collect();
    // A slip must not open the server to everybody.
    if config.api_keys.is_empty() { Err("at least one key".into()) } else { Ok(()) }
}

/// Sets origins as browsers write them: in lower case, without the port that the scheme has anyway.
fn set_cors_origins(config: &mut Config, value: &str) -> Result<(), String> {
    let words: Vec<&str> = value.split(',').map(str::trim).filter(|word| !word.is_empty()).collect();
    if words.contains(&super::ANY_ORIGIN) && words.len() > 1 {
        return Err("* alone, or origins without it".into());
    }
    let origin = |word: &str| {
        let word = word.to_ascii_lowercase();
        let (scheme, rest) = word.split_once("://")?;
        let default_port = match scheme {
            "http" => 80,
            "https" => 443,
            _ => return None,
        };
        let (host, port) = match rest.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (host, port.parse::<u16>().ok()?),
            _ => (rest, default_port),
        };
        let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || b".-[]:_".contains(&byte);
        if host.is_empty() || !host.bytes().all(is_allowed) {
            return None;
        }
        Some(if port == default_port { format!("{scheme}://{host}") } else { format!("{scheme}://{host}:{port}") })
    };
    let origins =
        words.into_iter().map(|word| if word == super::ANY_ORIGIN { Some(word.to_owned()) } else { origin(word) });
    config.cors_origins =
        origins.collect::<Option<_>>().ok_or("origins such as https://app.example or http://localhost:3000, or *")?;
    Ok(())
}

/// The text is read where it is used; here it is seen whether it can be.
fn set_webhook_secret(config: &mut Config, value: &str) -> Result<(), String> {
    let is_secret = value.strip_prefix("whsec_").is_some_and(|text| (32..=88).contains(&text.len()));
    if !is_secret {
        return Err("whsec_ and 24 to 64 bytes in base64, as echo whsec_$(openssl rand -base64 32) prints".into());
    }
    config.webhook_secret = Some(value.to_owned());
    Ok(())
}

/// An empty text is a slip, too.
fn set_file(file: &mut Option<PathBuf>, value: &str) -> Result<(), String> {
    if value.is_empty() {
        return Err("the path of a file".into());
    }
    set_folder(file, value)
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
    fn times_and_sizes_take_units_and_switches_words() {
        let mut config = Config::default();
        let mut set = |key: &str, value: &str| {
            let setting = SETTINGS.iter().find(|setting| setting.key == key).unwrap();
            setting.set(&mut config, value).map(|()| setting.show(&config))
        };
        for (key, value, expected) in [
            ("limit-job-ms", "500ms", "500"),
            ("limit-job-ms", "30s", "30000"),
            ("limit-job-ms", "2 m", "120000"),
            ("limit-job-ms", "1_000", "1000"),
            ("limit-body-bytes", "2MiB", "2097152"),
            ("ephemeral", "yes", "true"),
            ("ephemeral", "0", "false"),
            ("ephemeral", "True", "true"),
            ("ephemeral", "NO", "false"),
        ] {
            assert_eq!(set(key, value).as_deref(), Ok(expected), "{key} {value}");
        }
        for (key, value, part) in [
            ("limit-job-ms", "2MiB", "2s"),
            ("limit-job-ms", "-1s", "2s"),
            ("limit-job-ms", "99999999999999999999h", "2s"),
            ("limit-body-bytes", "30s", "2MiB"),
            ("workers", "2s", "1 to 1024"),
            ("ephemeral", "maybe", "yes or no"),
            ("ephemeral", "", "true or false"),
        ] {
            assert!(set(key, value).is_err_and(|allowed| allowed.contains(part)), "{key} {value}");
        }
    }
}
