//! The refusal of decompression bombs in binary FBX files. Their arrays may be deflated, each by
//! itself, and the parser `ufbx` trusts the declared sizes as far as memory allows. So the arrays whose
//! declared size is not plausible (for example more than 200 times the packed bytes) are added up
//! first, and a file with too many bytes of them is refused.
//!
//! The records follow the Blender Foundation's description ("FBX binary file format specification",
//! 2013): the end of the node, the number and length of its properties, its name, the properties,
//! and the child nodes up to an empty one.

use crate::import::MeshError;
use crate::limits::Deadline;

/// Ratio from which an array is suspicious. Honest arrays reach it only if they repeat one value
/// for every face.
const RATIO: u64 = 200;
/// Most bytes of suspicious arrays together, absolute and as a multiple of the file.
const BYTES_MAX: u64 = 16 << 20;
const FILES_MAX: u64 = 16;

/// Offset of the first record, after the signature and the byte order.
const VERSION_AT: usize = 23;
/// From this version on offsets have 64 bits.
const WIDE_VERSION: u64 = 7500;
/// Bytes per number once parsed, whatever its type in the file.
const NUMBER_BYTES: u64 = 8;

/// Refuses a binary file whose arrays are bombs. A broken record ends the walk: the parser then
/// reports it.
pub fn check(bytes: &[u8], deadline: &Deadline) -> Result<(), MeshError> {
    let mut cursor =
        Cursor { bytes, at: VERSION_AT, is_big_endian: bytes.get(VERSION_AT - 1).is_some_and(|&b| b != 0) };
    let is_wide = cursor.number(4).is_some_and(|version| version >= WIDE_VERSION);
    let allowed = BYTES_MAX.max(FILES_MAX.saturating_mul(bytes.len() as u64));
    let (mut total, mut records) = (0_u64, 0_u64);
    while let Some(inflated) = cursor.record(is_wide) {
        records += 1;
        if records.is_multiple_of(65_536) {
            deadline.check()?;
        }
        total = total.saturating_add(inflated);
        if total > allowed {
            return Err(MeshError::broken(format!(
                "arrays of the FBX file are more than {RATIO} times as large as their packed form, and {total} bytes or more \
                 together, which those of meshes are not"
            )));
        }
    }
    Ok(())
}

struct Cursor<'b> {
    bytes: &'b [u8],
    at: usize,
    is_big_endian: bool,
}

impl Cursor<'_> {
    /// Steps over a node's header and properties, to its first child. Returns the unpacked bytes of
    /// its suspicious arrays, or None at the end.
    fn record(&mut self, is_wide: bool) -> Option<u64> {
        let end = self.word(is_wide)?;
        let count = self.word(is_wide)?;
        let properties = self.word(is_wide)?;
        let name = self.number(1)?;
        self.skip(name)?;
        let mut suspicious = 0_u64;
        // The empty node that ends a list.
        if end == 0 && name == 0 {
            return Some(0);
        }
        // The declared length of the properties decides where they end, whatever their contents.
        let begin = self.at;
        self.skip(properties)?;
        let end = std::mem::replace(&mut self.at, begin);
        for _ in 0..count {
            let Some(unpacked) = self.property().filter(|_| self.at <= end) else { break };
            suspicious = suspicious.saturating_add(unpacked);
        }
        self.at = end;
        Some(suspicious)
    }

    fn property(&mut self) -> Option<u64> {
        let kind = self.number(1)? as u8;
        let size = match kind {
            b'C' | b'B' | b'U' | b'Z' => 1,
            b'Y' => 2,
            b'I' | b'F' => 4,
            b'D' | b'L' => 8,
            b'S' | b'R' => self.number(4)?,
            _ => return self.array(kind),
        };
        self.skip(size)?;
        Some(0)
    }

    fn array(&mut self, kind: u8) -> Option<u64> {
        let size = match kind {
            b'b' | b'c' => 1,
            b'f' | b'i' => 4,
            b'd' | b'l' => 8,
            _ => return None,
        };
        let [count, encoding, packed] = [self.number(4)?, self.number(4)?, self.number(4)?];
        self.skip(packed)?;
        let unpacked = count * NUMBER_BYTES;
        let is_honest = if encoding == 0 { count * size == packed } else { unpacked / RATIO <= packed };
        Some(if is_honest { 0 } else { unpacked })
    }

    fn word(&mut self, is_wide: bool) -> Option<u64> {
        self.number(if is_wide { 8 } else { 4 })
    }

    fn number(&mut self, bytes: usize) -> Option<u64> {
        let digits = self.bytes.get(self.at..self.at.checked_add(bytes)?)?;
        self.at += bytes;
        let digit = |k: usize| u64::from(digits[if self.is_big_endian { k } else { bytes - 1 - k }]);
        Some((0..bytes).fold(0, |sum, k| sum << 8 | digit(k)))
    }

    fn skip(&mut self, bytes: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(bytes).ok()?).filter(|&at| at <= self.bytes.len())?;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of four bytes in an order, as records of narrow files have them.
    fn words(is_big_endian: bool, words: &[u32]) -> Vec<u8> {
        words.iter().flat_map(|w| if is_big_endian { w.to_be_bytes() } else { w.to_le_bytes() }).collect()
    }

    fn header(is_big_endian: bool) -> Vec<u8> {
        let magic = b"Kaydara FBX Binary  \0\x1a";
        [&magic[..], &[u8::from(is_big_endian)], &words(is_big_endian, &[7400])].concat()
    }

    fn record(is_big_endian: bool, [end, count]: [u32; 2], name: &[u8], properties: &[u8]) -> Vec<u8> {
        let head = words(is_big_endian, &[end, count, properties.len() as u32]);
        [&head[..], &[name.len() as u8], name, properties].concat()
    }

    /// An array of so many numbers in 1000 bytes.
    fn array(is_big_endian: bool, kind: u8, count: u32, encoding: u32) -> Vec<u8> {
        [&[kind][..], &words(is_big_endian, &[count, encoding, 1000]), &[0; 1000]].concat()
    }

    #[test]
    fn bombs_are_found_behind_what_is_odd() {
        let bomb = |big| record(big, [9, 1], b"Vertices", &array(big, b'd', 5_000_000, 1));
        let cases = [
            ("alone", [header(false), bomb(false)].concat(), true),
            ("big-endian", [header(true), bomb(true)].concat(), true),
            (
                "behind a length without properties",
                [header(false), record(false, [9, 0], b"", b"?"), bomb(false)].concat(),
                true,
            ),
            ("behind an unknown kind", [header(false), record(false, [9, 2], b"X", b"??"), bomb(false)].concat(), true),
            ("behind a named end", [header(false), record(false, [0, 1], b"X", b"C1"), bomb(false)].concat(), true),
            (
                "of bytes",
                [header(false), record(false, [9, 1], b"X", &array(false, b'c', 4_000_000, 1))].concat(),
                true,
            ),
            (
                "not packed",
                [header(false), record(false, [9, 1], b"X", &array(false, b'd', 4_000_000, 0))].concat(),
                true,
            ),
            ("honest", [header(false), record(false, [9, 1], b"X", &array(false, b'd', 20_000, 1))].concat(), false),
        ];
        for (name, bytes, is_refused) in &cases {
            assert_eq!(check(bytes, &Deadline::default()).is_err(), *is_refused, "{name}");
        }
        assert_eq!(cases.len(), 8);
    }

    /// Each byte is looked at a few times, whatever counts say.
    #[test]
    fn counts_that_lie_cost_nothing() {
        let mut bytes = header(false);
        while bytes.len() < 20_000_000 {
            bytes.extend(record(false, [9, u32::MAX], b"", b"C"));
        }
        // More than a few visits per byte would take hours here.
        check(&bytes, &Deadline::default()).unwrap();
    }
}
