//! Signed addresses, for `<img>` tags: with one, a browser may GET a picture of a stored mesh without an API key, until the
//! address expires.
//!
//! The signature is HMAC-SHA256 over path and query, which ends in the time of expiry, in seconds since 1970:
//! `/v1/meshes/SHA256/render.png?style=wire&exp=1767225600`. The key of the HMAC is the text of an API key's SHA-256, in
//! hexadecimal digits. The signature is added as the last key of the query, `sig`, in hexadecimal digits.

use std::fmt::Write as _;

use hmac::{Hmac, KeyInit as _, Mac as _};
use sha2::Sha256;

const SIGNATURE: &str = "sig=";
const EXPIRY: &str = "exp=";

/// What is the matter with a signature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadSignature {
    /// No key has made it for this path and query.
    #[error("the signature is not one that a key of this server has made for this address")]
    Wrong,
    /// Its time is over.
    #[error("the signed address has expired; ask for a new one")]
    Expired,
}

/// A signed address, taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signed<'a> {
    /// Path and query without time of expiry and signature.
    pub plain: &'a str,
    /// The text that is signed.
    text: &'a str,
    expires_unix_s: u64,
    signature: &'a str,
}

/// Signs a path with its query under the digest of an API key, from now on until a time in seconds since 1970.
pub fn sign(key: &str, path_and_query: &str, expires_unix_s: u64) -> String {
    let mark = if path_and_query.contains('?') { '&' } else { '?' };
    let text = format!("{path_and_query}{mark}{EXPIRY}{expires_unix_s}");
    let digits = mac(key, &text).map(|mac| {
        mac.finalize().into_bytes().iter().fold(String::new(), |mut digits, byte| {
            let _ = write!(digits, "{byte:02x}");
            digits
        })
    });
    format!("{text}&{SIGNATURE}{}", digits.unwrap_or_default())
}

impl<'a> Signed<'a> {
    /// Takes an address apart. None if it is not signed.
    pub fn read(path_and_query: &'a str) -> Option<Self> {
        let (text, signature) = path_and_query.rsplit_once(&format!("&{SIGNATURE}"))?;
        let at = text.rfind(EXPIRY).filter(|&at| at > 0)?;
        let expires_unix_s = text[at + EXPIRY.len()..].parse().ok()?;
        let plain = text[..at].strip_suffix(['&', '?'])?;
        Some(Self { plain, text, expires_unix_s, signature })
    }

    /// The key that has made the signature, if it still counts.
    pub fn check<K>(
        &self,
        keys: impl IntoIterator<Item = K>,
        digest_of: impl Fn(&K) -> &str,
        now_unix_s: u64,
    ) -> Result<K, BadSignature> {
        let given = bytes(self.signature).ok_or(BadSignature::Wrong)?;
        // The comparison takes the same time wherever they differ.
        let has_made = |key: &K| mac(digest_of(key), self.text).is_some_and(|mac| mac.verify_slice(&given).is_ok());
        let key = keys.into_iter().find(has_made).ok_or(BadSignature::Wrong)?;
        if now_unix_s >= self.expires_unix_s { Err(BadSignature::Expired) } else { Ok(key) }
    }
}

/// None cannot occur: HMAC takes keys of any length.
fn mac(key: &str, text: &str) -> Option<Hmac<Sha256>> {
    let mut mac = Hmac::<Sha256>::new_from_slice(key.as_bytes()).ok()?;
    mac.update(text.as_bytes());
    Some(mac)
}

fn bytes(digits: &str) -> Option<[u8; 32]> {
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    let mut bytes = [0; 32];
    if pairs.len() != bytes.len() || !rest.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return None;
    }
    for (byte, pair) in bytes.iter_mut().zip(pairs) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use crate::signature::{BadSignature, Signed, sign};

    #[test]
    fn a_signature_is_for_one_address_one_key_and_a_time() {
        let keys = ["one".to_owned(), "two".to_owned()];
        for plain in ["/v1/meshes/ab/render.png", "/v1/meshes/ab/render.png?style=wire&size=64"] {
            let url = sign("two", plain, 1000);
            let signed = Signed::read(&url).unwrap();
            assert_eq!(signed.plain, plain);
            assert_eq!(signed.check(&keys, |key| key, 999), Ok(&"two".to_owned()));
            assert_eq!(signed.check(&keys, |key| key, 1000), Err(BadSignature::Expired));
            assert_eq!(signed.check(&keys[..1], |key| key, 999), Err(BadSignature::Wrong));
            let changed = [
                url.replace("exp=1000", "exp=9999"),
                url.replace("ab", "ac"),
                url.replace("png", "jpg"),
                format!("{}0", &url[..url.len() - 1]).replace("sig=", "sig=0"),
                url[..url.len() - 2].to_owned(),
                format!("{}é", &url[..url.len() - 2]),
            ];
            for url in &changed {
                assert_eq!(
                    Signed::read(url).map(|signed| signed.check(&keys, |key| key, 999)),
                    Some(Err(BadSignature::Wrong)),
                    "{url}"
                );
            }
        }
        for url in ["/v1/x", "/v1/x?sig=00", "/v1/x?exp=1", "exp=1&sig=0", "/x?exp=&sig=1", "/x?exp=-1&sig=1", ""] {
            assert_eq!(Signed::read(url), None, "{url}");
        }
    }

    /// `printf '/a?exp=1000' | openssl dgst -sha256 -hmac key`
    #[test]
    fn other_programs_can_sign() {
        let expected = "/a?exp=1000&sig=5803eeeca9015b5d084ce7faa9d226639b98c206cf66d8a4b38096ddcd779425";
        assert_eq!(sign("key", "/a", 1000), expected);
    }
}
