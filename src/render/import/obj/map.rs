//! A texture statement of an MTL file: options, then a file name that may have spaces.

use crate::import::text;
use crate::mesh::material::{TextureRef, Wrap};

/// Longest file name that is kept, in bytes. No file of a bundle has a longer path.
const NAME_BYTES_MAX: usize = 1024;

/// A parsed texture statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The file's name, as it is in the file.
    pub name: Vec<u8>,
    /// `-s`: texture coordinates are multiplied by this.
    pub scale: [f64; 2],
    /// `-o`: and this is added.
    pub offset: [f64; 2],
    /// `-clamp on`: nothing repeats.
    pub clamp: bool,
    /// `-bm`: strength of a bump or normal map.
    pub strength: Option<f64>,
}

impl Map {
    /// Parses the text after the keyword. None without a name, or with one too long for a file.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let mut map = Self { name: Vec::new(), scale: [1.0; 2], offset: [0.0; 2], clamp: false, strength: None };
        let mut rest = text.trim_ascii();
        while rest.starts_with(b"-") {
            let (option, after) = split_word(rest);
            rest = match option {
                b"-s" => numbers(after, &mut map.scale),
                b"-o" => numbers(after, &mut map.offset),
                b"-t" => numbers(after, &mut [0.0; 2]),
                b"-mm" => pass_words(after, 2),
                b"-bm" => {
                    let (word, after) = split_word(after);
                    map.strength = number(word);
                    after
                }
                b"-clamp" => {
                    let (word, after) = split_word(after);
                    map.clamp = word == b"on";
                    after
                }
                b"-blendu" | b"-blendv" | b"-cc" | b"-texres" | b"-boost" | b"-imfchan" | b"-type" => {
                    pass_words(after, 1)
                }
                // A name may begin with a dash.
                _ => break,
            };
        }
        if rest.is_empty() || rest.len() > NAME_BYTES_MAX {
            return None;
        }
        map.name = rest.to_vec();
        Some(map)
    }

    /// The texture reference for image number `image`.
    ///
    /// Viewers agree on `uv * scale + offset` with v up (the Wavefront text speaks of the size of
    /// the pattern, which would be the inverse). With v down, `v' = 1 - ((1 - v) * s + o) = s * v +
    /// (1 - s - o)`.
    pub fn texture(&self, image: u32) -> TextureRef {
        let ([su, sv], [ou, ov]) = (self.scale, self.offset);
        let mut texture = TextureRef::new(image);
        texture.transform = [[su as f32, 0.0, ou as f32], [0.0, sv as f32, (1.0 - sv - ov) as f32]];
        if self.clamp {
            texture.wrap = [Wrap::Clamp; 2];
        }
        texture
    }
}

/// A finite number of reasonable size.
pub fn number(word: &[u8]) -> Option<f64> {
    let number = text::number(word)?;
    // Beyond this, nothing that is computed from it in f32 would be finite.
    (number.abs() < 1e9).then_some(number)
}

/// The first word, and what follows it.
pub fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    (&text[..end], text[end..].trim_ascii_start())
}

fn pass_words(mut text: &[u8], count: usize) -> &[u8] {
    for _ in 0..count {
        text = split_word(text).1;
    }
    text
}

/// One to three numbers, of which the first two count. The last word of a line is never one of
/// them: it is the name.
fn numbers<'t>(mut text: &'t [u8], values: &mut [f64; 2]) -> &'t [u8] {
    for i in 0..3 {
        let (word, after) = split_word(text);
        let Some(value) = number(word).filter(|_| !after.is_empty()) else { break };
        if let Some(place) = values.get_mut(i) {
            *place = value;
        }
        text = after;
    }
    text
}
