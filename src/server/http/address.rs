//! URLs at which pictures of stored meshes can be fetched again, and their `ETag`s. A tag is a digest of all that
//! decides the picture, so that it is known before anything is drawn.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

use super::state::AppState;
use crate::digest::Digest;
use crate::store::Reading;
use meshsnap_render::spec::{BackendChoice, Spec};

/// Longest address that is given out: proxies and browsers may refuse longer ones.
const URL_BYTES_MAX: usize = 2000;

/// Bytes that are escaped in a query: all but unreserved ones (RFC 3986, 2.3) and those that vectors, sheets and names of files
/// have.
const ESCAPED: &AsciiSet =
    &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b',').remove(b':').remove(b'/');

/// The address at which a picture can be fetched again.
pub struct Address {
    /// The URL, without a host.
    pub url: String,
    /// The picture's tag at this URL.
    pub etag: String,
}

impl Address {
    /// The address of a picture of a stored mesh. `keys` are the dotted keys of its request
    /// document. None if the document does not name a format or the URL would be too long.
    pub fn new(
        state: &AppState,
        digest: Digest,
        reading: &Reading,
        spec: &Spec,
        keys: &[(String, String)],
    ) -> Option<Self> {
        let extension = spec.image.format?.extension();
        let format_in = reading.format_in.map(|format| ("format_in", format.name()));
        let entry = reading.entry.as_deref().map(|entry| ("entry", entry));
        let keys = keys.iter().map(|(key, text)| (key.as_str(), text.as_str())).chain(format_in).chain(entry);
        let escaped = |part| utf8_percent_encode(part, ESCAPED);
        let query: Vec<String> = keys.map(|(key, text)| format!("{}={}", escaped(key), escaped(text))).collect();
        let mark = if query.is_empty() { "" } else { "?" };
        let url = format!("/v1/meshes/{digest}/render.{extension}{mark}{}", query.join("&"));
        (url.len() <= URL_BYTES_MAX).then(|| Self { url, etag: render_key(state, digest, reading, spec) })
    }
}

/// The tag of a picture: a digest of all that decides it, so that it is known before anything is
/// drawn. Requests with the same meaning have the same key, whatever their order or short names.
///
/// The CPU's bytes are the same on every machine, so its tag is strong. Two GPUs, or a GPU and the
/// CPU that replaces it, may differ in the last place, so the tag is weak where a GPU may draw.
pub fn render_key(state: &AppState, digest: Digest, reading: &Reading, spec: &Spec) -> String {
    let may_be_gpu = match spec.backend {
        BackendChoice::Cpu => false,
        BackendChoice::Auto => state.gpu.may_have_hardware(),
        BackendChoice::Gpu => true,
    };
    // Debug output is unambiguous: it has every field, exact numbers and quoted text.
    let key = format!("{} {digest} {reading:?} {spec:?} {may_be_gpu}", env!("CARGO_PKG_VERSION"));
    let weak = if may_be_gpu { "W/" } else { "" };
    format!("{weak}\"{}\"", Digest::of(key.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use percent_encoding::percent_decode_str;

    #[test]
    fn a_query_keeps_unreserved_characters_and_those_of_vectors_and_names() {
        for byte in 0..=0x7f_u8 {
            let text = char::from(byte).to_string();
            let escaped = utf8_percent_encode(&text, ESCAPED).to_string();
            let is_kept = byte.is_ascii_alphanumeric() || b"-._~,:/".contains(&byte);
            assert_eq!(escaped, if is_kept { text } else { format!("%{byte:02X}") });
        }
        let text = "käse & wein=100%+#?.glb";
        let escaped = utf8_percent_encode(text, ESCAPED).to_string();
        assert_eq!(escaped, "k%C3%A4se%20%26%20wein%3D100%25%2B%23%3F.glb");
        assert_eq!(percent_decode_str(&escaped).decode_utf8().unwrap(), text);
    }
}
