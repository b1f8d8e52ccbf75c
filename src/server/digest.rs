//! SHA-256 digests, such as the names of stored meshes and of bytes in the data folder.

use std::fmt;

use sha2::{Digest as _, Sha256};

use meshsnap_render::import::BundleFile;

/// Number of hexadecimal digits in a digest.
const DIGITS: usize = 64;

/// A SHA-256 digest. Its text is 64 lower-case hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Digest([u8; 32]);

impl Digest {
    /// The digest of bytes, as `sha256sum` prints it.
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// The digest of named files in any order. It is the digest of a list with a line `digest
    /// name` per file, sorted by name, as `sha256sum FILE... | LC_ALL=C sort -k 2` writes it.
    ///
    /// No mesh file has the bytes of such a list, so a form and a file never share a name. No text
    /// format has statements that begin with 64 digits. Names have no control characters, so as a
    /// binary STL the list would have more triangles than a body can hold.
    pub fn of_files(files: &[BundleFile]) -> Self {
        let mut lines: Vec<(&str, Self)> = files.iter().map(|f| (f.path.as_str(), Self::of(&f.bytes))).collect();
        lines.sort_unstable();
        let list: String = lines.iter().map(|(name, digest)| format!("{digest}  {name}\n")).collect();
        Self::of(list.as_bytes())
    }

    /// The digest with these 32 bytes.
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Its 32 bytes.
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Reads a digest's text. None for anything else, upper case included, so that a mesh has one
    /// name.
    pub fn parse(text: &str) -> Option<Self> {
        let value = |digit: u8| match digit {
            b'0'..=b'9' => Some(digit - b'0'),
            b'a'..=b'f' => Some(digit - b'a' + 10),
            _ => None,
        };
        let (pairs, _) = text.as_bytes().as_chunks::<2>();
        let mut bytes = [0; DIGITS / 2];
        if text.len() != DIGITS {
            return None;
        }
        for (byte, [high, low]) in bytes.iter_mut().zip(pairs) {
            *byte = value(*high)? << 4 | value(*low)?;
        }
        Some(Self(bytes))
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use crate::digest::Digest;
    use meshsnap_render::import::BundleFile;

    /// FIPS 180-2, appendix B.1.
    const ABC: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    #[test]
    fn the_text_is_that_of_sha256sum_and_comes_back() {
        let digest = Digest::of(b"abc");
        assert_eq!(digest.to_string(), ABC);
        assert_eq!(Digest::parse(ABC), Some(digest));
        let upper = ABC.to_uppercase();
        let bad = ["", "..", &ABC[1..], &upper, &ABC.replace('b', "g"), &format!("{ABC}0"), &"é".repeat(32), "../../x"];
        for text in bad {
            assert_eq!(Digest::parse(text), None, "{text}");
        }
        assert_eq!(bad.len(), 8);
    }

    #[test]
    fn the_order_of_files_does_not_matter_and_their_names_do() {
        let file = |name: &str, bytes: &'static [u8]| BundleFile::new(name, bytes).unwrap();
        let files = [file("b", b"abc"), file("a c", b""), file("a/c", b"x")];
        let [x, y, z] = files.clone();
        assert_eq!(Digest::of_files(&files), Digest::of_files(&[z.clone(), x.clone(), y.clone()]));
        assert_ne!(Digest::of_files(&files), Digest::of_files(&[x.clone(), y.clone()]));
        assert_ne!(Digest::of_files(&[file("a", b"b")]), Digest::of_files(&[file("b", b"b")]));
        assert_ne!(
            Digest::of_files(&[file("a", b"x"), file("b", b"y")]),
            Digest::of_files(&[file("a", b"y"), file("b", b"x")])
        );
        let list = format!("{ABC}  b\n");
        assert_eq!(Digest::of_files(&[x]), Digest::of(list.as_bytes()));
    }
}
