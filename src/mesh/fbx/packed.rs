//! Arrays of a binary FBX file are deflated one by one, and `ufbx` believes what they say of their size as far as memory goes. What was made
//! to fill it is refused before.
//!
//! The records as the Blender Foundation describes them ("FBX binary file format specification", 2013): where a node ends, how many
//! properties it has, how long they are, its name, the properties, and then the nodes inside of it, up to an empty one.

use crate::limits::Deadline;
use crate::mesh::MeshError;

/// No array of a mesh is this many times as large as its packed form, except for those that say the same of every face.
const RATIO: u64 = 200;
/// Such arrays are together at most this large, or this many times as large as the file.
const BYTES_MAX: u64 = 16 << 20;
const FILES_MAX: u64 = 16;

/// Before the first record.
const HEADER_BYTES: usize = 27;
/// From this version on places have 64 bits.
const WIDE_VERSION: u32 = 7500;

/// Refuses a binary file whose arrays are bombs. What cannot be followed is left to the parser, which says what is wrong with it.
pub fn check(bytes: &[u8], deadline: &Deadline) -> Result<(), MeshError> {
    let mut cursor = Cursor { bytes, at: HEADER_BYTES };
    let is_wide = bytes.get(23..27).is_some_and(is_wide);
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

fn is_wide(version: &[u8]) -> bool {
    version.try_into().is_ok_and(|v| u32::from_le_bytes(v) >= WIDE_VERSION)
}

struct Cursor<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl Cursor<'_> {
    /// Passes a node's own part; what it contains comes next. Gives the bytes that its suspicious arrays unpack to; None at the end.
    fn record(&mut self, is_wide: bool) -> Option<u64> {
        let end = self.word(is_wide)?;
        let count = self.word(is_wide)?;
        self.word(is_wide)?;
        let name = self.number(1)?;
        self.skip(name)?;
        let mut suspicious = 0_u64;
        // The empty node that ends a list.
        if end == 0 {
            return Some(0);
        }
        for _ in 0..count {
            suspicious = suspicious.saturating_add(self.property()?);
        }
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
        let unpacked = count * size;
        Some(if encoding != 0 && unpacked / RATIO > packed { unpacked } else { 0 })
    }

    fn word(&mut self, is_wide: bool) -> Option<u64> {
        self.number(if is_wide { 8 } else { 4 })
    }

    /// Little-endian.
    fn number(&mut self, bytes: usize) -> Option<u64> {
        let digits = self.bytes.get(self.at..self.at.checked_add(bytes)?)?;
        self.at += bytes;
        Some(digits.iter().rev().fold(0, |sum, &byte| sum << 8 | u64::from(byte)))
    }

    fn skip(&mut self, bytes: u64) -> Option<()> {
        self.at = self.at.checked_add(usize::try_from(bytes).ok()?).filter(|&at| at <= self.bytes.len())?;
        Some(())
    }
}
