//! Addresses to which webhooks may be sent: http or https, without user and password. IP addresses of private
//! networks and `localhost` are refused unless that is allowed; `client.rs` checks what other names lead to.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::sync::Arc;

use ureq::http::Uri;

/// Longest address, characters.
const CHARS_MAX: usize = 2000;

/// An address of a webhook.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    address: Arc<str>,
    host: Arc<str>,
}

/// Reasons why an address is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadTarget {
    /// Not an address of the right kind.
    #[error(
        "the webhook must be an http or https address of at most {CHARS_MAX} characters, such as \
         https://ci.example/hooks/meshsnap, without user, password and fragment"
    )]
    Malformed,
    /// It is of a private network.
    #[error("the webhook's address is of a private network, which this server does not allow (--webhooks-to-private)")]
    Private,
}

impl Target {
    /// Reads an address. A name is looked up when something is sent to it.
    pub fn read(address: &str, to_private: bool) -> Result<Self, BadTarget> {
        let is_text = !address.contains('#') && address.bytes().all(|byte| byte.is_ascii_graphic());
        if address.len() > CHARS_MAX || !is_text {
            return Err(BadTarget::Malformed);
        }
        let uri: Uri = address.parse().map_err(|_| BadTarget::Malformed)?;
        let authority = uri.authority().filter(|authority| !authority.as_str().contains('@'));
        let authority = authority.ok_or(BadTarget::Malformed)?;
        let host = authority.host();
        // A port that is none is dropped by `host` and `port`.
        let port = authority.as_str().strip_prefix(host).unwrap_or("?");
        let has_port = port.is_empty() || port.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok());
        if !matches!(uri.scheme_str(), Some("http" | "https")) || host.is_empty() || !has_port {
            return Err(BadTarget::Malformed);
        }
        let number = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        if !to_private && (number.is_ok_and(|number| !is_public(number)) || is_local_name(host)) {
            return Err(BadTarget::Private);
        }
        Ok(Self { address: address.into(), host: host.to_ascii_lowercase().into() })
    }

    /// An address that was read before.
    pub fn stored(address: &str) -> Result<Self, BadTarget> {
        Self::read(address, true)
    }

    /// The whole address.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Its host.
    pub fn host(&self) -> &str {
        &self.host
    }
}

fn is_local_name(host: &str) -> bool {
    let host = host.trim_end_matches('.').to_ascii_lowercase();
    host == "localhost" || host.ends_with(".localhost")
}

/// True for an address of the public internet.
pub fn is_public(address: IpAddr) -> bool {
    match address.to_canonical() {
        IpAddr::V4(address) => is_public_v4(address),
        IpAddr::V6(address) => is_public_v6(address),
    }
}

fn is_public_v4(address: Ipv4Addr) -> bool {
    // Networks of the registry of special purposes (IANA), multicast, and what is reserved.
    const NOT_PUBLIC: [(Ipv4Addr, u32); 15] = [
        (Ipv4Addr::new(0, 0, 0, 0), 8),
        (Ipv4Addr::new(10, 0, 0, 0), 8),
        (Ipv4Addr::new(100, 64, 0, 0), 10),
        (Ipv4Addr::new(127, 0, 0, 0), 8),
        (Ipv4Addr::new(169, 254, 0, 0), 16),
        (Ipv4Addr::new(172, 16, 0, 0), 12),
        (Ipv4Addr::new(192, 0, 0, 0), 24),
        (Ipv4Addr::new(192, 0, 2, 0), 24),
        (Ipv4Addr::new(192, 88, 99, 0), 24),
        (Ipv4Addr::new(192, 168, 0, 0), 16),
        (Ipv4Addr::new(198, 18, 0, 0), 15),
        (Ipv4Addr::new(198, 51, 100, 0), 24),
        (Ipv4Addr::new(203, 0, 113, 0), 24),
        (Ipv4Addr::new(224, 0, 0, 0), 4),
        (Ipv4Addr::new(240, 0, 0, 0), 4),
    ];
    let is_in = |(network, bits): &(Ipv4Addr, u32)| (address.to_bits() ^ network.to_bits()) >> (32 - bits) == 0;
    !NOT_PUBLIC.iter().any(is_in)
}

fn is_public_v6(address: Ipv6Addr) -> bool {
    let parts = address.segments();
    let v4 = |high: u16, low: u16| Ipv4Addr::from_bits(u32::from(high) << 16 | u32::from(low));
    match parts {
        // Addresses of version 4 within those of version 6: NAT64 and 6to4.
        [0x64, 0xff9b, 0, 0, 0, 0, high, low] => is_public_v4(v4(high, low)),
        [0x2002, high, low, ..] => is_public_v4(v4(high, low)),
        // 2001::/23 has protocols (Teredo, ORCHID), 2001:db8::/32 and 3fff::/20 documentation.
        [0x2001, second, ..] if second < 0x200 || second == 0xdb8 => false,
        [0x3fff, second, ..] if second < 0x1000 => false,
        // All that is public today.
        [first, ..] => first >> 13 == 1,
    }
}
