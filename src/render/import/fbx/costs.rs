//! The refusal of FBX files that could keep the parser `ufbx` busy for long without a deadline
//! check. Two of its loops take a time that grows with a product of the numbers of some nodes.
//!
//! One is about textures that are made of other textures: the square of their number, times the
//! number of all textures. The other searches the sets of texture coordinates and tangents for each
//! entry of a layer (`LayerElement`). The names of these nodes, or of their properties, are counted in
//! the bytes before the file is parsed, as binary files and text files write them. Bytes that only look
//! like such a name count, too.

use crate::import::context::Context;
use crate::import::{MeshError, MeshFault};

/// Most steps of the loop that collects the textures of which others are made: their number, squared, times all textures.
/// About a second.
const COLLECTED_MAX: u64 = 32_000_000;
/// Most pairs of a layer's entry and a set of coordinates, which it is searched among: about a
/// second.
const LOOKUPS_MAX: u64 = 2_000_000_000;
/// Bytes between two deadline checks.
const BYTES_PER_POLL: usize = 1 << 20;

/// Occurrences of the names that those loops depend on.
#[derive(Debug, Default, PartialEq, Eq)]
struct Counts {
    textures: u64,
    layered: u64,
    /// Textures that 3ds Max computes from others.
    shaders: u64,
    /// One of those may be called anything.
    names_shaders: bool,
    /// Sets of coordinates, tangents and bitangents.
    sets: u64,
    /// Entries of layers.
    entries: u64,
}

/// Refuses a file that would take too long to parse.
pub fn check(bytes: &[u8], cx: &Context<'_>) -> Result<(), MeshError> {
    let mut counts = Counts::default();
    let is_binary = bytes.starts_with(b"Kaydara FBX Binary");
    for start in (0..bytes.len()).step_by(BYTES_PER_POLL) {
        cx.deadline.check()?;
        for at in start..bytes.len().min(start + BYTES_PER_POLL) {
            if matches!(bytes[at], b'T' | b'L' | b'P' | b'3' | b'O') {
                counts.add(bytes, at, is_binary);
            }
        }
    }
    counts.judge()
}

impl Counts {
    /// Counts the name that begins at `at`.
    fn add(&mut self, bytes: &[u8], at: usize, is_binary: bool) {
        let rest = &bytes[at..];
        let is_node = |name: &[u8]| rest.starts_with(name) && is_name(bytes, at, name.len(), is_binary);
        if is_node(b"Texture") {
            self.textures += 1;
        } else if is_node(b"LayeredTexture") {
            self.layered += 1;
        } else if is_node(b"LayerElement") {
            self.entries += 1;
        } else if is_node(b"LayerElementUV") || is_node(b"LayerElementTangent") || is_node(b"LayerElementBinormal") {
            self.sets += 1;
        } else if rest.starts_with(b"Parameters/Connections") || rest.starts_with(b"3dsMax|parameters") {
            self.shaders += 1;
        } else if rest.starts_with(b"OSLShaderName") {
            self.names_shaders = true;
        }
    }

    fn judge(&self) -> Result<(), MeshError> {
        let shaders = if self.names_shaders { self.textures } else { self.shaders.min(self.textures) };
        let made = self.layered + shaders;
        let collected = made.saturating_mul(made).saturating_mul(self.textures + made);
        if collected > COLLECTED_MAX {
            return refused(&format!(
                "the FBX file has {made} textures made of others (LayeredTexture, and what 3ds Max computes) and {} textures: {made} times {made} times {} is \
                 more than the {COLLECTED_MAX} that are read",
                self.textures,
                self.textures + made
            ));
        }
        let (sets, entries) = (self.sets, self.entries);
        if sets.saturating_mul(entries) > LOOKUPS_MAX {
            return refused(&format!(
                "the FBX file has {sets} sets of texture coordinates and tangents (LayerElementUV and its like) and {entries} \
                 entries of layers (LayerElement): {sets} times {entries} is more than the {LOOKUPS_MAX} that are read"
            ));
        }
        Ok(())
    }
}

fn refused(detail: &str) -> Result<(), MeshError> {
    Err(MeshError::new(MeshFault::Unsupported, detail))
}

/// True if the word at `at` can be the name of a node: preceded by its length in a binary file, a
/// whole word in a text.
fn is_name(bytes: &[u8], at: usize, length: usize, is_binary: bool) -> bool {
    let before = at.checked_sub(1).and_then(|before| bytes.get(before)).copied().unwrap_or(b' ');
    if is_binary {
        return usize::from(before) == length;
    }
    // A name begins with a letter, but may follow a number without a space.
    if before.is_ascii_alphabetic() || before == b'_' {
        return false;
    }
    let after = bytes.get(at + length..).unwrap_or_default();
    if let Some(quoted) = after.strip_prefix(b"\"") {
        return quoted.starts_with(b":");
    }
    // A comment may come before the colon. Two colons occur in names of objects, which are strings.
    let next = after.iter().position(|byte| *byte > b' ').map_or(b' ', |next| after[next]);
    matches!(next, b':' | b';') && !after.starts_with(b"::")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(bytes: &[u8]) -> Counts {
        let mut counts = Counts::default();
        let is_binary = bytes.starts_with(b"Kaydara FBX Binary");
        (0..bytes.len()).for_each(|at| counts.add(bytes, at, is_binary));
        counts
    }

    #[test]
    fn names_are_counted_in_texts_and_in_binary_files() {
        let text = b"; FBX\nLayeredTexture: 1, \"Texture::x\" {}\nTexture : 2\n 1Texture: 3\nTextureName: \"Texture\"\n\"LayerElementUV\": 0 {}\nLayerElement: {}\n";
        let expected = Counts { textures: 2, layered: 1, sets: 1, entries: 1, ..Counts::default() };
        assert_eq!(counts(text), expected);
        let binary = b"Kaydara FBX Binary  \x00\x0eLayeredTextureL\x07TextureL\x0bTextureName\x0eLayerElementUV\x0cLayerElement\x0bTexture";
        assert_eq!(counts(binary), Counts { textures: 1, ..expected });
        let shaders =
            counts(b"P: \"3dsMax|params|OSLShaderName\" P: \"3dsMax|parameters\" \"a Parameters/Connections\"");
        assert_eq!(shaders, Counts { shaders: 2, names_shaders: true, ..Counts::default() });
    }

    #[test]
    fn what_real_files_have_is_far_from_the_caps() {
        let real = Counts { textures: 3000, layered: 40, sets: 30_000, entries: 60_000, ..Counts::default() };
        assert_eq!(real.judge(), Ok(()));
        let shaders = Counts { textures: 252, names_shaders: true, ..Counts::default() };
        assert!(shaders.judge().unwrap_err().detail.contains("252 textures made of others"));
        assert_eq!(Counts { textures: 251, names_shaders: true, ..Counts::default() }.judge(), Ok(()));
        let chain = Counts { textures: 1000, layered: 1000, ..Counts::default() };
        let error = chain.judge().unwrap_err();
        assert_eq!(error.fault, MeshFault::Unsupported);
        assert!(error.detail.contains("1000 textures made of others"), "{error}");
        let sets = Counts { sets: 50_000, entries: 50_000, ..Counts::default() };
        assert!(sets.judge().unwrap_err().detail.contains("50000 entries of layers"));
    }
}
