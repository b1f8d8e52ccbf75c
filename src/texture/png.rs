//! The chunks of a PNG that say what its pixels are.
//!
//! A colour profile or a text chunk may inflate to any size, or be large itself, before the first row; nothing here reads
//! them. Dropped before the decoder sees them, they cost nothing, and fail no picture that is otherwise fine.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

/// Reads a PNG without its ancillary chunks, other than the one for transparency.
#[derive(Debug)]
pub struct Essentials<'b> {
    /// What remains of the signature or of a chunk that is kept.
    current: &'b [u8],
    /// The chunks behind it.
    rest: &'b [u8],
}

impl<'b> Essentials<'b> {
    /// Of a whole file.
    pub fn new(bytes: &'b [u8]) -> Self {
        let (current, rest) = bytes.split_at(bytes.len().min(8));
        Self { current, rest }
    }

    /// Goes on to the next chunk that is kept. What is cut short stays so: the decoder says what is wrong with it.
    fn advance(&mut self) {
        /// Length, type and checksum.
        const FRAME_BYTES: usize = 12;
        while self.current.is_empty() && !self.rest.is_empty() {
            let (chunk, rest) = match *self.rest {
                [a, b, c, d, ..] => {
                    let size = (u32::from_be_bytes([a, b, c, d]) as usize).saturating_add(FRAME_BYTES);
                    self.rest.split_at(size.min(self.rest.len()))
                }
                _ => (self.rest, &[][..]),
            };
            self.rest = rest;
            // Chunks whose name starts with a small letter are ancillary. Half a name is none.
            let is_ancillary = chunk.get(4..8).is_some_and(|name| name[0] & 0x20 != 0 && name != b"tRNS");
            if !is_ancillary {
                self.current = chunk;
            }
        }
    }
}

impl Read for Essentials<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(out)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Essentials<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.advance();
        Ok(self.current)
    }

    fn consume(&mut self, count: usize) {
        self.current = self.current.get(count..).unwrap_or_default();
    }
}

impl Seek for Essentials<'_> {
    /// The decoder asks for this ability, and reads from front to back.
    fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(kind: &[u8], size: u32) -> Vec<u8> {
        [&size.to_be_bytes()[..], kind, &vec![7; size as usize + 4]].concat()
    }

    fn kept(bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        assert!(Essentials::new(bytes).read_to_end(&mut out).is_ok());
        out
    }

    #[test]
    fn only_what_pixels_need_is_kept() {
        let signature = b"signatur";
        let [ihdr, plte, trns, idat] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT"].map(|kind| chunk(kind, 30));
        let [iccp, ztxt, exif] = [b"iCCP", b"zTXt", b"eXIf"].map(|kind| chunk(kind, 100_000));
        let all = [&signature[..], &ihdr, &iccp, &ztxt, &plte, &exif, &trns, &idat, &ztxt, &idat].concat();
        let want = [&signature[..], &ihdr, &plte, &trns, &idat, &idat].concat();
        assert_eq!(kept(&all), want);
        assert_eq!(kept(&want), want);
        // Cut anywhere, nothing new comes of it.
        for cut in 0..want.len() {
            assert_eq!(kept(&want[..cut]), want[..cut]);
        }
        // A length that lies takes the rest of the file.
        let lie = [&signature[..], &u32::MAX.to_be_bytes(), b"iCCP", &idat].concat();
        assert_eq!(kept(&lie), signature);
    }
}
