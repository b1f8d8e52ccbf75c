//! The body of a binary OFF file: big-endian 32-bit integers and floats.

use super::header::Header;
use super::{Counts, Number, Source};
use crate::import::MeshError;
use crate::import::context::Context;

/// Reads numbers one after the other.
pub struct Binary<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Binary<'a> {
    /// The numbers from `at` on.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    fn word(&mut self) -> Result<[u8; 4], MeshError> {
        let word = self.bytes.get(self.at..self.at + 4).and_then(|word| word.try_into().ok());
        let word = word.ok_or_else(|| self.broken("the file ends here"))?;
        self.at += 4;
        Ok(word)
    }

    fn count(&mut self) -> Result<u32, MeshError> {
        let count = i32::from_be_bytes(self.word()?);
        u32::try_from(count).map_err(|_| self.broken(&format!("the count {count} is negative")))
    }

    fn float(&mut self) -> Result<Number, MeshError> {
        Ok(Number { value: f64::from(f32::from_be_bytes(self.word()?)), is_whole: false })
    }
}

impl Source for Binary<'_> {
    fn counts(&mut self) -> Result<Counts, MeshError> {
        let (vertices, faces) = (self.count()?, u64::from(self.count()?));
        self.count()?;
        Ok(Counts { vertices, faces })
    }

    fn bytes_min(&self, numbers: u64) -> [u64; 2] {
        [4 * numbers, 8]
    }

    fn left(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }

    fn vertex(&mut self, header: &Header, out: &mut Vec<Number>) -> Result<(), MeshError> {
        // Colours have four components here, always.
        let numbers = header.numbers_min() + usize::from(header.has_colors);
        for _ in 0..numbers {
            out.push(self.float()?);
        }
        Ok(())
    }

    fn face(&mut self, corners: &mut Vec<f64>, color: &mut Vec<Number>, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let count = self.count()?;
        if u64::from(count) > self.left() / 4 {
            return Err(self.broken(&format!("a face of {count} corners is more than the file has left")));
        }
        cx.budget.spend("the corners of a face", if count > 1000 { u64::from(count) } else { 0 }, 16)?;
        for _ in 0..count {
            let index = i32::from_be_bytes(self.word()?);
            corners.push(f64::from(index));
        }
        let components = self.count()?;
        if components > 4 {
            return Err(self.broken(&format!("a colour has at most 4 components, and this one {components}")));
        }
        for _ in 0..components {
            color.push(self.float()?);
        }
        Ok(())
    }

    fn broken(&self, what: &str) -> MeshError {
        MeshError::broken(format!("byte {} of the binary OFF file: {what}", self.at))
    }

    fn trailing_bytes(&mut self) -> usize {
        self.bytes.len() - self.at
    }
}
