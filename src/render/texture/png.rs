//! A reader that drops a PNG's ancillary chunks, except `tRNS` (transparency), the one that changes pixels. The
//! decoder of textures reads PNG files through it.
//!
//! A colour profile or a text chunk may be large, or inflate to any size, and decoders read them
//! before the first row. Textures need neither. Dropped here, they cost nothing and cannot fail an
//! image whose pixels are fine.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

/// Reads a PNG's signature, its critical chunks and `tRNS`, the one ancillary chunk that changes
/// pixels. Its buffer is the unread rest of the signature or of one whole chunk.
#[derive(Debug)]
pub struct CriticalChunks<'b> {
    /// Unread bytes of the signature or of the current chunk.
    current: &'b [u8],
    /// The chunks after it.
    rest: &'b [u8],
}

impl<'b> CriticalChunks<'b> {
    /// A reader of a whole file.
    pub fn new(bytes: &'b [u8]) -> Self {
        let (current, rest) = bytes.split_at(bytes.len().min(8));
        Self { current, rest }
    }

    /// Moves on to the next chunk that is kept, once the current one is read. A truncated chunk is
    /// passed on as it is, and the decoder reports it.
    fn advance(&mut self) {
        /// Length, type and checksum around a chunk's data.
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
            // The type of an ancillary chunk begins with a lower-case letter. A truncated type
            // counts as critical.
            let is_ancillary = chunk.get(4..8).is_some_and(|name| name[0] & 0x20 != 0 && name != b"tRNS");
            if !is_ancillary {
                self.current = chunk;
            }
        }
    }
}

impl Read for CriticalChunks<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(out)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for CriticalChunks<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.advance();
        Ok(self.current)
    }

    fn consume(&mut self, count: usize) {
        self.current = self.current.get(count..).unwrap_or_default();
    }
}

impl Seek for CriticalChunks<'_> {
    /// The decoder's bounds ask for `Seek`, but it only reads from front to back.
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
        assert!(CriticalChunks::new(bytes).read_to_end(&mut out).is_ok());
        out
    }

    #[test]
    fn only_chunks_that_change_pixels_are_kept() {
        let signature = b"signatur";
        let [ihdr, plte, trns, idat] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT"].map(|kind| chunk(kind, 30));
        let [iccp, ztxt, exif] = [b"iCCP", b"zTXt", b"eXIf"].map(|kind| chunk(kind, 100_000));
        let all = [&signature[..], &ihdr, &iccp, &ztxt, &plte, &exif, &trns, &idat, &ztxt, &idat].concat();
        let want = [&signature[..], &ihdr, &plte, &trns, &idat, &idat].concat();
        assert_eq!(kept(&all), want);
        assert_eq!(kept(&want), want);
        // A truncated file passes through unchanged.
        for cut in 0..want.len() {
            assert_eq!(kept(&want[..cut]), want[..cut]);
        }
        // A false length swallows the rest of the file.
        let lie = [&signature[..], &u32::MAX.to_be_bytes(), b"iCCP", &idat].concat();
        assert_eq!(kept(&lie), signature);
    }
}
