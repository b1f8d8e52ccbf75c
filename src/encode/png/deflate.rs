//! Deflate for filtered rows: literals, and runs of zeros. RFC 1950 and 1951.
//!
//! One block has the whole stream, with one code of literals and lengths. The code is fitted to a
//! sample of the rows, so that rows are written as soon as they are filtered. The only distance is
//! 1: it repeats the zero before.

use simd_adler32::Adler32;

use super::huffman::{self, Code, bits, length};

/// Literals, the end of the block, and 29 lengths.
const SYMBOLS: usize = 286;
/// The end of the block.
const END: usize = 256;
/// Bits of the longest code. Four of them and what is left of a byte fit a word.
const CODE_BITS_MAX: usize = 14;
/// Bytes that are looked at together.
const BLOCK: usize = 32;
/// A count weighs as much against one symbol that the sample lacks.
const COUNT_WEIGHT: u32 = 8;
/// Longest run that a match can repeat.
const MATCH_MAX: usize = 258;
/// The shortest one.
const MATCH_MIN: usize = 3;
/// Zeros that are written as literals rather than as a match.
const LITERAL_ZEROS_MAX: usize = 4;

/// How often symbols occur in some rows.
pub struct Sample {
    counts: [u32; SYMBOLS],
    zeros: usize,
}

/// A code that fits a sample.
pub struct Fitted {
    lengths: Vec<u8>,
    /// Bits of the sample itself.
    pub sample_bits: u64,
}

impl Sample {
    /// A sample of no rows.
    pub fn new() -> Self {
        Self { counts: [0; SYMBOLS], zeros: 0 }
    }

    /// Adds a filtered row.
    pub fn add(&mut self, line: &[u8]) {
        let Self { counts, zeros } = self;
        walk(line, zeros, Counter { counts });
    }

    /// The code. It has all symbols, also those that the sample lacks.
    pub fn fit(mut self) -> Fitted {
        Counter { counts: &mut self.counts }.zeros(self.zeros);
        let mut weights = self.counts.map(|count| count.saturating_mul(COUNT_WEIGHT).saturating_add(1));
        weights[END] = 1;
        let lengths = huffman::lengths(&weights, CODE_BITS_MAX);
        let sample_bits = self.counts.iter().zip(&lengths).map(|(n, bits)| u64::from(*n) * u64::from(*bits)).sum();
        Fitted { lengths, sample_bits }
    }
}

/// A zlib stream while it is written.
pub struct Stream {
    codes: [Code; SYMBOLS],
    out: Vec<u8>,
    position: Position,
    checksum: Adler32,
    /// Zeros that are not written yet.
    zeros: usize,
}

impl Stream {
    /// A stream without rows, with room for about `bytes`.
    pub fn new(fitted: &Fitted, bytes: usize) -> Self {
        let mut codes = [0; SYMBOLS];
        codes.iter_mut().zip(huffman::codes(&fitted.lengths)).for_each(|(place, code)| *place = code);
        let mut stream =
            Self { codes, out: vec![0; bytes], position: Position::default(), checksum: Adler32::new(), zeros: 0 };
        stream.header(&fitted.lengths);
        stream
    }

    /// Adds a filtered row.
    pub fn add(&mut self, line: &[u8]) {
        self.checksum.write(line);
        // A literal takes less than two bytes, and a run less than the literals in its place.
        self.make_room(2 * line.len());
        let Self { codes, out, position, zeros, .. } = self;
        *position = walk(line, zeros, Writer { codes, out, position: *position }).position;
    }

    /// The bytes of the stream.
    pub fn finish(mut self) -> Vec<u8> {
        self.make_room(64 + self.zeros / MATCH_MAX * 2);
        let writer = Writer { codes: &self.codes, out: &mut self.out, position: self.position };
        let Writer { out, mut position, .. } = writer.zeros(self.zeros).symbol(END);
        // Up to a whole byte.
        position = position.put(out, 0, 7);
        let mut bytes = self.out;
        bytes.truncate(position.at);
        bytes.extend(self.checksum.finish().to_be_bytes());
        bytes
    }

    fn make_room(&mut self, bytes: usize) {
        // Whole words are written.
        let needed = self.position.at + bytes + 64;
        if self.out.len() < needed {
            self.out.resize(needed.max(2 * self.out.len()), 0);
        }
    }

    /// The header of zlib, and that of the block: the lengths of its codes, themselves coded.
    fn header(&mut self, lengths: &[u8]) {
        /// The order in which the lengths of the codes of lengths are stored.
        const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
        const REPEAT: usize = 16;
        // After the literals and lengths, the single distance has a code of one bit.
        let all: Vec<u8> = lengths.iter().copied().chain([1]).collect();
        let mut steps = Vec::with_capacity(all.len());
        for same in all.chunk_by(|a, b| a == b) {
            steps.push((usize::from(same[0]), 0, 0));
            let mut left = same.len() - 1;
            while left >= 3 {
                steps.push((REPEAT, left.min(6) as u64 - 3, 2));
                left -= left.min(6);
            }
            steps.resize(steps.len() + left, (usize::from(same[0]), 0, 0));
        }
        let mut counts = [0; ORDER.len()];
        steps.iter().for_each(|step| counts[step.0] += 1);
        let own_lengths = huffman::lengths(&counts, 7);
        let own_codes: Vec<Code> = huffman::codes(&own_lengths).collect();
        self.make_room(8 * ORDER.len() + 2 * steps.len());
        let (out, mut position) = (&mut self.out, self.position);
        // A window of 32 KiB, no dictionary.
        position = position.put(out, u64::from(u16::from_le_bytes([0x78, 0x01])), 16);
        // The last block, of codes of its own: 286 of literals and lengths, 1 of a distance.
        position = position.put(out, 0b101, 3).put(out, SYMBOLS as u64 - 257, 5).put(out, 0, 5);
        position = position.put(out, ORDER.len() as u64 - 4, 4);
        for symbol in ORDER {
            position = position.put(out, u64::from(own_lengths[symbol]), 3);
        }
        for (symbol, extra, extra_bits) in steps {
            let code = own_codes[symbol];
            position = position.put(out, bits(code) | extra << length(code), length(code) + extra_bits);
        }
        self.position = position;
    }
}

/// The end of a stream of bits. It is passed by value, so that it stays in registers.
#[derive(Clone, Copy, Default)]
struct Position {
    /// Bits that do not make a whole byte yet.
    rest: u64,
    rest_bits: u32,
    /// The byte that they belong to.
    at: usize,
}

impl Position {
    /// Adds up to 56 bits. There is room for eight bytes.
    #[inline(always)]
    fn put(self, out: &mut [u8], bits: u64, count: u32) -> Self {
        let word = self.rest | bits << self.rest_bits;
        let filled = self.rest_bits + count;
        if let Some(place) = out.get_mut(self.at..self.at + 8) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        Self { rest: word.wrapping_shr(filled & !7), rest_bits: filled & 7, at: self.at + (filled >> 3) as usize }
    }
}

/// Takes the symbols of rows.
trait Sink: Sized {
    /// Four literals.
    fn four(self, literals: [u8; 4]) -> Self;
    /// One.
    fn one(self, literal: u8) -> Self;
    /// A run of zeros, of any length.
    fn zeros(self, count: usize) -> Self;
}

/// The symbols of a row, after `zeros` that are not written yet. The row's last zeros are left in
/// there.
#[inline(always)]
fn walk<S: Sink>(line: &[u8], zeros: &mut usize, mut sink: S) -> S {
    let (blocks, rest) = line.as_chunks::<BLOCK>();
    let mut run = *zeros;
    for block in blocks {
        if *block == [0; BLOCK] {
            run += BLOCK;
            continue;
        }
        // Zeros between others are literals.
        let fours = block.as_chunks::<4>().0;
        let others = (0..).zip(fours).fold(0_u32, |bits, (i, four)| bits | u32::from(*four != [0; 4]) << i);
        let (begin, end) = (others.trailing_zeros() as usize, 32 - others.leading_zeros() as usize);
        run += 4 * begin;
        if run > 0 {
            sink = sink.zeros(run);
        }
        for &four in &fours[begin..end] {
            sink = sink.four(four);
        }
        run = BLOCK - 4 * end;
    }
    for &literal in rest {
        if literal == 0 {
            run += 1;
            continue;
        }
        if run > 0 {
            sink = sink.zeros(run);
            run = 0;
        }
        sink = sink.one(literal);
    }
    *zeros = run;
    sink
}

/// The symbols of a run of zeros, each with its further bits and their number.
fn run_symbols(count: usize, mut each: impl FnMut(usize, u64, u32)) {
    let literals = if count > LITERAL_ZEROS_MAX { 1 } else { count };
    (0..literals).for_each(|_| each(0, 0, 0));
    let mut left = count - literals;
    while left > 0 {
        // What a match leaves over is long enough for another one.
        let run = if left > MATCH_MAX { MATCH_MAX.min(left - MATCH_MIN) } else { left };
        left -= run;
        let (symbol, extra, extra_bits) = match_symbol(run);
        // The code of the distance is a zero bit.
        each(symbol, extra, extra_bits + 1);
    }
}

/// The symbol of a match, its further bits and their number. Four symbols share each number of
/// bits, but the first eight lengths have none, and the last one is a symbol of its own.
fn match_symbol(run: usize) -> (usize, u64, u32) {
    let over = run - MATCH_MIN;
    if run == MATCH_MAX {
        return (285, 0, 0);
    }
    let extra_bits = over.checked_ilog2().unwrap_or(0).saturating_sub(2);
    let symbol = END + 1 + 4 * extra_bits as usize + (over >> extra_bits);
    (symbol, over as u64 & ((1 << extra_bits) - 1), extra_bits)
}

struct Counter<'a> {
    counts: &'a mut [u32; SYMBOLS],
}

impl Sink for Counter<'_> {
    #[inline(always)]
    fn four(self, literals: [u8; 4]) -> Self {
        literals.into_iter().fold(self, Self::one)
    }

    #[inline(always)]
    fn one(self, literal: u8) -> Self {
        self.counts[usize::from(literal)] += 1;
        self
    }

    fn zeros(self, count: usize) -> Self {
        run_symbols(count, |symbol, _, _| self.counts[symbol] += 1);
        self
    }
}

struct Writer<'a> {
    codes: &'a [Code; SYMBOLS],
    out: &'a mut [u8],
    position: Position,
}

impl Writer<'_> {
    fn symbol(mut self, symbol: usize) -> Self {
        let code = self.codes[symbol];
        self.position = self.position.put(self.out, bits(code), length(code));
        self
    }
}

impl Sink for Writer<'_> {
    #[inline(always)]
    fn four(mut self, literals: [u8; 4]) -> Self {
        let [a, b, c, d] = literals.map(|literal| self.codes[usize::from(literal)]);
        let (ab, abc) = (a.wrapping_add(b), a.wrapping_add(b).wrapping_add(c));
        let all = bits(a) | bits(b) << length(a) | bits(c) << length(ab) | bits(d) << length(abc);
        self.position = self.position.put(self.out, all, length(abc.wrapping_add(d)));
        self
    }

    #[inline(always)]
    fn one(self, literal: u8) -> Self {
        self.symbol(usize::from(literal))
    }

    #[inline(never)]
    fn zeros(mut self, count: usize) -> Self {
        run_symbols(count, |symbol, extra, extra_bits| {
            let code = self.codes[symbol];
            let all = bits(code) | extra << length(code);
            self.position = self.position.put(self.out, all, length(code) + extra_bits);
        });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_written_by_symbols_of_its_length() {
        for count in (1..2000).chain([100_000]) {
            let mut zeros = 0;
            run_symbols(count, |symbol, extra, extra_bits| {
                zeros += match symbol {
                    0 => 1,
                    285 => 258,
                    // RFC 1951, 3.2.5.
                    257..265 => symbol - 257 + 3,
                    _ => {
                        let bits = (symbol - 261) / 4;
                        assert_eq!(extra_bits as usize, bits + 1);
                        ((4 + (symbol - 265) % 4) << bits) + 3 + extra as usize
                    }
                };
            });
            assert_eq!(zeros, count);
        }
    }

    #[test]
    fn rows_inflate_to_themselves_whatever_the_code_is_fitted_to() {
        let mut state = 5_u64;
        let mut below = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) % n
        };
        let mut streams = 0;
        for zeros in [0, 1, 3, 50, 400, 3000] {
            for largest in [1, 3, 255] {
                let mut lines = Vec::new();
                for line in 0..20 {
                    let mut bytes = vec![line % 3];
                    while bytes.len() < 37 + 50 * usize::from(line) {
                        bytes.push(1 + below(largest) as u8);
                        bytes.resize(bytes.len() + below(zeros + 1) as usize, 0);
                    }
                    lines.push(bytes);
                }
                // Of all rows, of one, and of rows that the stream has not.
                for sample in [&lines[..], &lines[7..8], &[vec![7; 100]], &[]] {
                    let mut of = Sample::new();
                    sample.iter().for_each(|line| of.add(line));
                    let mut stream = Stream::new(&of.fit(), 10);
                    lines.iter().for_each(|line| stream.add(line));
                    let bytes = stream.finish();
                    assert_eq!(fdeflate::decompress_to_vec(&bytes).unwrap(), lines.concat(), "{zeros} {largest}");
                    streams += 1;
                }
            }
        }
        assert_eq!(streams, 72);
        assert!(fdeflate::decompress_to_vec(&Stream::new(&Sample::new().fit(), 0).finish()).unwrap().is_empty());
    }
}
