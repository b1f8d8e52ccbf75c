//! The body of a binary PLY file, in either byte order. As long as faces are triangles in their
//! most frequent layout (a count of 8 bits, three indices of 32 bits), all records have the same
//! length, and several threads read them.

use super::header::Kind;
use super::layout::{Layout, Step};
use super::source::{Columns, Source};
use crate::parallel::map;

/// Reads numbers. `BIG`: most significant byte first.
pub struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
}

/// Evaluates an expression with `$type` as the Rust type of a kind. Loops inside are then compiled
/// per type instead of matching per number.
macro_rules! by_kind {
    ($kind:expr, $type:ident => $body:expr) => {
        match $kind {
            Kind::I8 => by_kind!(@ i8, $type, $body),
            Kind::U8 => by_kind!(@ u8, $type, $body),
            Kind::I16 => by_kind!(@ i16, $type, $body),
            Kind::U16 => by_kind!(@ u16, $type, $body),
            Kind::I32 => by_kind!(@ i32, $type, $body),
            Kind::U32 => by_kind!(@ u32, $type, $body),
            Kind::F32 => by_kind!(@ f32, $type, $body),
            Kind::F64 => by_kind!(@ f64, $type, $body),
        }
    };
    (@ $rust:ty, $type:ident, $body:expr) => {{
        type $type = $rust;
        $body
    }};
}

/// A number type in a file. `bytes` has exactly its length.
trait Number {
    fn read<const BIG: bool>(bytes: &[u8]) -> f64;
}

macro_rules! number {
    ($($type:ty),*) => {$(
        impl Number for $type {
            fn read<const BIG: bool>(bytes: &[u8]) -> f64 {
                let mut own = [0; size_of::<Self>()];
                own.copy_from_slice(bytes);
                if BIG {
                    own.reverse();
                }
                f64::from(Self::from_le_bytes(own))
            }
        }
    )*};
}
number!(i8, u8, i16, u16, i32, u32, f32, f64);

impl<'a, const BIG: bool> Binary<'a, BIG> {
    /// Reads `bytes` from `at` on.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }
}

/// Bytes of a record that is a triangle: a count and three indices.
const TRIANGLE_BYTES: usize = 1 + 3 * 4;
/// Triangles handed to a thread at a time.
const TRIANGLES_PER_PIECE: usize = 16_384;

/// True if records are one list of 32-bit indices after a count of 8 bits.
fn is_triangles(layout: &Layout) -> bool {
    let (Kind::I8 | Kind::U8, Kind::I32 | Kind::U32) = (match layout.steps[..] {
        [Step::List { count, item, slot: Some(0) }] => (count, item),
        _ => return false,
    }) else {
        return false;
    };
    true
}

/// The triangle of a record, if it is one and its indices are below `vertices`.
#[inline(always)]
fn triangle<const BIG: bool>(record: &[u8; TRIANGLE_BYTES], vertices: u32) -> Option<[u32; 3]> {
    let index = |at: usize| {
        let own = [record[at], record[at + 1], record[at + 2], record[at + 3]];
        if BIG { u32::from_be_bytes(own) } else { u32::from_le_bytes(own) }
    };
    let triangle = [index(1), index(5), index(9)];
    // A negative index is too large, too.
    let below = vertices.min(i32::MAX as u32);
    (record[0] == 3 && triangle[0] < below && triangle[1] < below && triangle[2] < below).then_some(triangle)
}

/// The length of the run that a list begins with. For each of its pieces there is the length of the
/// run it begins with, and its own.
fn leading(runs: &[(usize, usize)]) -> usize {
    let whole = runs.iter().take_while(|(run, all)| run == all).count();
    runs.iter().take(whole + 1).map(|(run, _)| run).sum()
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    fn triangles_max(&self, layout: &Layout, records: u64) -> u64 {
        if !is_triangles(layout) {
            return 0;
        }
        let body = &self.bytes[self.at..];
        let body =
            &body[..body.len().min(usize::try_from(records).unwrap_or(usize::MAX).saturating_mul(TRIANGLE_BYTES))];
        let runs = map(body.chunks(TRIANGLES_PER_PIECE * TRIANGLE_BYTES).collect(), |records: &[u8]| {
            let run = records.as_chunks::<TRIANGLE_BYTES>().0.iter().take_while(|record| record[0] == 3).count();
            (run, records.len() / TRIANGLE_BYTES)
        });
        leading(&runs) as u64
    }

    fn triangles(&mut self, records: u64, vertices: u32, corners: &mut Vec<u32>) {
        let count = records as usize;
        let before = corners.len();
        if before == 0 {
            // Memory from the system is zero, so nothing has to be written.
            *corners = vec![0; 3 * count];
        } else {
            corners.resize(before + 3 * count, 0);
        }
        let records =
            self.bytes[self.at..self.at + count * TRIANGLE_BYTES].chunks(TRIANGLES_PER_PIECE * TRIANGLE_BYTES);
        let pieces = records.zip(corners[before..].chunks_mut(3 * TRIANGLES_PER_PIECE)).collect();
        let runs = map(pieces, |(records, corners): (&[u8], &mut [u32])| {
            let mut run = 0;
            let places = corners.as_chunks_mut::<3>().0;
            for (record, place) in records.as_chunks::<TRIANGLE_BYTES>().0.iter().zip(places) {
                let Some(triangle) = triangle::<BIG>(record, vertices) else { break };
                *place = triangle;
                run += 1;
            }
            (run, records.len() / TRIANGLE_BYTES)
        });
        let run = leading(&runs);
        corners.truncate(before + 3 * run);
        self.at += run * TRIANGLE_BYTES;
    }

    fn value(&mut self, kind: Kind) -> Option<f64> {
        let bytes = self.take(kind.bytes())?;
        Some(by_kind!(kind, T => T::read::<BIG>(bytes)))
    }

    fn values(&mut self, kind: Kind, count: usize, items: &mut Vec<f64>) -> Option<()> {
        let bytes = self.take(count.checked_mul(kind.bytes())?)?;
        by_kind!(kind, T => items.extend(bytes.chunks_exact(size_of::<T>()).map(T::read::<BIG>)));
        Some(())
    }

    fn skip(&mut self, _numbers: usize, bytes: usize) -> Option<()> {
        self.take(bytes).map(|_| ())
    }

    fn block(&mut self, bytes: usize) -> Option<&[u8]> {
        self.take(bytes)
    }

    fn columns(layout: &Layout, stride: usize, records: &[u8], columns: &mut Columns) {
        for step in &layout.steps {
            let Step::Value { kind, slot, offset } = *step else { continue };
            let column = &mut columns[slot];
            column.clear();
            by_kind!(kind, T => {
                let of_record = |record: &[u8]| T::read::<BIG>(&record[offset..offset + size_of::<T>()]);
                column.extend(records.chunks_exact(stride).map(of_record));
            });
        }
    }

    fn is_in_columns(&self) -> bool {
        true
    }

    fn numbers_left(&self, kind: Kind) -> u64 {
        (self.bytes.len() - self.at) as u64 / kind.bytes() as u64
    }

    fn at(&self) -> usize {
        self.at
    }

    fn place(&self, at: usize) -> String {
        format!("byte {at} of the PLY file")
    }

    fn why(&self) -> String {
        "the file ends within".into()
    }

    fn trailing_bytes(&self) -> usize {
        self.bytes.len() - self.at
    }
}
