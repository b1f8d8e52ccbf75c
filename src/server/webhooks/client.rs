//! One attempt to deliver a webhook: a signed POST, and what its outcome means (delivered, to be tried again, or in vain).
//! A name that has only addresses of private networks is refused here, unless these are allowed.

use std::io;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;
use ureq::Agent;
use ureq::http::Uri;
use ureq::tls::{PemItem, RootCerts, TlsConfig, parse_pem};
use ureq::unversioned::resolver::{DefaultResolver, ResolvedSocketAddrs, Resolver};
use ureq::unversioned::transport::{DefaultConnector, NextTimeout};

use super::Delivery;
use super::target::is_public;

/// Time for one attempt, from looking up the name to the head of the answer.
const TIME: Duration = Duration::from_secs(10);

/// Bytes of a secret, by the rules of Standard Webhooks.
const SECRET_BYTES: std::ops::RangeInclusive<usize> = 24..=64;

/// The beginning of a secret's text.
const SECRET_PREFIX: &str = "whsec_";

/// Reads the certificates of a file in PEM. None if there are none, or the file is broken.
pub fn roots(pem: &[u8]) -> Option<RootCerts> {
    let certificates = parse_pem(pem).filter_map(|item| match item {
        Ok(PemItem::Certificate(certificate)) => Some(Ok(certificate)),
        Ok(_) => None,
        Err(error) => Some(Err(error)),
    });
    let certificates: Vec<_> = certificates.collect::<Result<_, _>>().ok()?;
    (!certificates.is_empty()).then(|| RootCerts::from(certificates))
}

/// The result of an attempt.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The receiver has it.
    Taken,
    /// Another attempt may do better.
    Failed(String),
    /// No attempt will do better.
    Refused(String),
}

/// The key of signatures.
#[derive(Clone)]
pub struct Secret(Vec<u8>);

impl Secret {
    /// Reads `whsec_` and 24 to 64 bytes in base64.
    pub fn read(text: &str) -> Option<Self> {
        let bytes = BASE64_STANDARD.decode(text.strip_prefix(SECRET_PREFIX)?).ok()?;
        SECRET_BYTES.contains(&bytes.len()).then_some(Self(bytes))
    }

    /// The signature of a delivery at this time.
    pub fn sign(&self, id: &str, unix_s: u64, payload: &str) -> Option<String> {
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0).ok()?;
        mac.update(format!("{id}.{unix_s}.{payload}").as_bytes());
        Some(format!("v1,{}", BASE64_STANDARD.encode(mac.finalize().into_bytes())))
    }
}

/// Looks names up, and leaves out private addresses. What it returns is what is connected to, so that no second lookup
/// can say otherwise.
#[derive(Debug)]
struct Lookup {
    to_private: bool,
    inner: DefaultResolver,
}

impl Resolver for Lookup {
    fn resolve(
        &self,
        uri: &Uri,
        config: &ureq::config::Config,
        timeout: NextTimeout,
    ) -> Result<ResolvedSocketAddrs, ureq::Error> {
        let all = self.inner.resolve(uri, config, timeout)?;
        if self.to_private {
            return Ok(all);
        }
        let mut public = self.empty();
        all.iter().filter(|address| is_public(address.ip())).for_each(|address| public.push(*address));
        if public.is_empty() {
            return Err(ureq::Error::Io(io::Error::new(io::ErrorKind::PermissionDenied, PRIVATE)));
        }
        Ok(public)
    }
}

const PRIVATE: &str = "the name has addresses of private networks alone";

/// Sends deliveries.
pub struct Client(Agent);

impl Client {
    /// A client that connects to private addresses, or does not, and trusts receivers by these roots.
    pub fn new(to_private: bool, roots: RootCerts) -> Self {
        let config = Agent::config_builder()
            .timeout_global(Some(TIME))
            .http_status_as_error(false)
            .tls_config(TlsConfig::builder().root_certs(roots).build())
            .max_redirects(0)
            .max_redirects_will_error(false)
            // A proxy would look the name up itself.
            .proxy(None)
            .max_idle_connections(0)
            .user_agent(concat!("meshsnap/", env!("CARGO_PKG_VERSION")))
            .build();
        let lookup = Lookup { to_private, inner: DefaultResolver::default() };
        Self(Agent::with_parts(config, DefaultConnector::default(), lookup))
    }

    /// Tries once. Of the answer, the status counts alone, and its body is not read.
    pub fn send(&self, delivery: &Delivery, secret: &Secret) -> Outcome {
        let unix_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        let Some(signature) = secret.sign(&delivery.id, unix_s, &delivery.payload) else {
            return Outcome::Refused("it cannot be signed".to_owned());
        };
        let request = self.0.post(delivery.target.address()).header("content-type", "application/json");
        let request = request.header("webhook-id", &delivery.id).header("webhook-timestamp", unix_s.to_string());
        match request.header("webhook-signature", signature).send(delivery.payload.as_str()) {
            Ok(answer) => match answer.status().as_u16() {
                200..=299 => Outcome::Taken,
                410 => Outcome::Refused("the receiver is gone (410)".to_owned()),
                status => Outcome::Failed(format!("the receiver answered {status}")),
            },
            Err(ureq::Error::Io(error)) if error.kind() == io::ErrorKind::PermissionDenied => {
                Outcome::Refused(error.to_string())
            }
            Err(error) => Outcome::Failed(error.to_string()),
        }
    }
}
