//! A zlib stream of filtered rows: Huffman codes and runs of zeros.
//!
//! Of what a general compressor does, renderings need little: what a filter leaves of background
//! and flat faces is zeros, the rest hardly repeats itself. So the only matches are runs of zeros
//! (RFC 1951: distance 1), in whole groups of eight bytes. All else is a literal without a branch.
//! The codes are fitted to some of the rows, and there is one block.

use simd_adler32::Adler32;

/// Symbols of literals and lengths: bytes, the end of the block, and 29 ranges of lengths.
const SYMBOLS: usize = 286;

/// The end of the block.
const END: usize = 256;

/// The longest code, bits: four of these and what a byte has left fit 64 bits.
const BITS_MAX: usize = 12;

/// The longest match.
const LENGTH_MAX: usize = 258;

/// Bytes looked at together.
const GROUP: usize = 8;

/// How often each symbol is expected.
pub struct Histogram([u32; SYMBOLS]);

impl Histogram {
    /// Each symbol once, because any may occur.
    pub fn new() -> Self {
        Self([1; SYMBOLS])
    }

    /// Counts a row's symbols.
    pub fn add(&mut self, row: &[u8]) {
        for_each_piece(row, |piece| match piece {
            Piece::Literals(bytes) => bytes.iter().for_each(|&byte| self.0[usize::from(byte)] += 1),
            Piece::Zeros(count) => {
                self.0[0] += 1;
                for_each_length(count - 1, |length| match length {
                    1 | 2 => self.0[0] += length as u32,
                    _ => self.0[length_symbol(length).0] += 1,
                });
            }
        });
    }
}

/// What a row is made of.
enum Piece<'a> {
    Literals(&'a [u8]),
    /// At least [`GROUP`] zeros.
    Zeros(usize),
}

#[inline(always)]
fn for_each_piece(row: &[u8], mut each: impl FnMut(Piece<'_>)) {
    let (groups, rest) = row.as_chunks::<GROUP>();
    let mut zeros = 0;
    for group in groups {
        if u64::from_le_bytes(*group) == 0 {
            zeros += GROUP;
            continue;
        }
        if zeros > 0 {
            each(Piece::Zeros(zeros));
            zeros = 0;
        }
        each(Piece::Literals(group));
    }
    if zeros > 0 {
        each(Piece::Zeros(zeros));
    }
    if !rest.is_empty() {
        each(Piece::Literals(rest));
    }
}

/// Cuts a run into lengths of matches; 1 and 2 are too short to be one.
#[inline(always)]
fn for_each_length(mut left: usize, mut each: impl FnMut(usize)) {
    while left > 0 {
        let length = left.min(LENGTH_MAX);
        each(length);
        left -= length;
    }
}

/// The symbol of a length from 3 on, its offset in the symbol's range, and the bits of that.
#[inline(always)]
fn length_symbol(length: usize) -> (usize, u64, u32) {
    let offset = length - 3;
    if length == LENGTH_MAX {
        return (285, 0, 0);
    }
    // Ranges double in size after each four.
    let bits = (usize::BITS - 1 - (offset | 4).leading_zeros()) - 2;
    let symbol = 257 + 4 * bits as usize + (offset >> bits);
    (symbol, (offset & ((1 << bits) - 1)) as u64, bits)
}

/// A symbol's code, first bit lowest, and its length.
#[derive(Clone, Copy, Default)]
struct Code {
    bits: u32,
    len: u32,
}

/// Compresses rows one after the other.
pub struct Compressor {
    codes: [Code; SYMBOLS],
    bytes: Vec<u8>,
    /// Bytes that are complete; the list is longer.
    end: usize,
    /// Bits that do not fill a byte yet.
    pending: u64,
    pending_len: u32,
    checksum: Adler32,
}

impl Compressor {
    /// One whose codes fit the histogram, with room for `capacity` bytes.
    pub fn new(histogram: &Histogram, capacity: usize) -> Self {
        let lens = code_lens(&histogram.0);
        let mut compressor = Self {
            codes: codes(&lens),
            bytes: Vec::with_capacity(capacity),
            end: 0,
            pending: 0,
            pending_len: 0,
            checksum: Adler32::new(),
        };
        compressor.make_room(64 + SYMBOLS);
        compressor.write_header(&lens);
        compressor
    }

    /// Compresses a row.
    pub fn write_row(&mut self, row: &[u8]) {
        self.checksum.write(row);
        // Each byte takes at most 12 bits.
        self.make_room(row.len() * 2 + 64);
        for_each_piece(row, |piece| match piece {
            Piece::Literals(bytes) => match bytes.as_chunks::<4>() {
                ([first, second], []) => {
                    self.literals(first);
                    self.literals(second);
                }
                _ => bytes.iter().for_each(|&byte| self.symbol(usize::from(byte))),
            },
            Piece::Zeros(count) => {
                self.symbol(0);
                for_each_length(count - 1, |length| self.zeros(length));
            }
        });
    }

    /// The zlib stream.
    pub fn finish(mut self) -> Vec<u8> {
        self.make_room(64);
        self.symbol(END);
        let unused = self.pending_len.next_multiple_of(8) - self.pending_len;
        self.bits(0, unused);
        self.bytes.truncate(self.end);
        self.bytes.extend(self.checksum.finish().to_be_bytes());
        self.bytes
    }

    /// RFC 1950, 2.2, and RFC 1951, 3.2.7.
    fn write_header(&mut self, lens: &[u8; SYMBOLS]) {
        // Deflate with the largest window, fastest.
        self.bits(0x0178, 16);
        // The last block, with its own codes: 286 of them, one distance, 19 lengths of codes.
        self.bits(1 | 2 << 1 | 29 << 3 | 15 << 13, 17);
        // In the order of the format. The lengths 0 to 15 have four bits each, repetitions have none.
        for symbol in [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15] {
            self.bits(if symbol < 16 { 4 } else { 0 }, 3);
        }
        // The only distance has one bit.
        for &len in lens.iter().chain(&[1]) {
            self.bits(u64::from(len.reverse_bits() >> 4), 4);
        }
    }

    #[inline(always)]
    fn literals(&mut self, bytes: &[u8; 4]) {
        let [a, b, c, d] = bytes.map(|byte| self.codes[usize::from(byte)]);
        let low = u64::from(a.bits | b.bits << a.len);
        let high = u64::from(c.bits | d.bits << c.len);
        let low_len = a.len + b.len;
        self.bits(low | high << low_len, low_len + c.len + d.len);
    }

    #[inline(always)]
    fn symbol(&mut self, symbol: usize) {
        let Code { bits, len } = self.codes[symbol];
        self.bits(u64::from(bits), len);
    }

    /// Repeats the zero before.
    #[inline(always)]
    fn zeros(&mut self, length: usize) {
        if length < 3 {
            (0..length).for_each(|_| self.symbol(0));
            return;
        }
        let (symbol, offset, offset_len) = length_symbol(length);
        let Code { bits, len } = self.codes[symbol];
        // The code of the distance is a 0.
        self.bits(u64::from(bits) | offset << len, len + offset_len + 1);
    }

    /// Adds up to 56 bits.
    #[inline(always)]
    fn bits(&mut self, bits: u64, len: u32) {
        let all = self.pending | bits << self.pending_len;
        let all_len = self.pending_len + len;
        if let Some(bytes) = self.bytes[self.end..].first_chunk_mut() {
            *bytes = all.to_le_bytes();
        }
        self.end += (all_len / 8) as usize;
        self.pending = all >> (all_len & !7);
        self.pending_len = all_len % 8;
    }

    fn make_room(&mut self, more: usize) {
        if self.bytes.len() < self.end + more {
            self.bytes.resize(self.end + more, 0);
        }
    }
}

/// Lengths of Huffman codes, at most [`BITS_MAX`].
fn code_lens(counts: &[u32; SYMBOLS]) -> [u8; SYMBOLS] {
    let mut order: Vec<usize> = (0..SYMBOLS).collect();
    order.sort_by_key(|&symbol| counts[symbol]);
    // Leaves in ascending order, then the nodes that join two, which come in ascending order too.
    let mut weights: Vec<u64> = order.iter().map(|&symbol| u64::from(counts[symbol])).collect();
    let mut parents = vec![0; 2 * SYMBOLS - 1];
    let (mut leaf, mut node) = (0, SYMBOLS);
    for next in SYMBOLS..2 * SYMBOLS - 1 {
        let mut weight = 0;
        for _ in 0..2 {
            let is_leaf = leaf < SYMBOLS && (node >= next || weights[leaf] <= weights[node]);
            let least = if is_leaf { &mut leaf } else { &mut node };
            weight += weights[*least];
            parents[*least] = next;
            *least += 1;
        }
        weights.push(weight);
    }
    let mut depths = vec![0_usize; 2 * SYMBOLS - 1];
    for i in (0..2 * SYMBOLS - 2).rev() {
        depths[i] = depths[parents[i]] + 1;
    }
    let mut lens = [0; SYMBOLS];
    // Of 2^BITS_MAX places, a code of `n` bits takes 2^(BITS_MAX - n), and all must be taken. Codes
    // that are too long are cut.
    let places_of = |len: u8| 1 << (BITS_MAX - usize::from(len));
    let mut free = 1_i32 << BITS_MAX;
    for (i, &symbol) in order.iter().enumerate() {
        lens[symbol] = depths[i].min(BITS_MAX) as u8;
        free -= places_of(lens[symbol]);
    }
    // Then the rarest that can become longer do, until all have a place.
    for &symbol in &order {
        while free < 0 && usize::from(lens[symbol]) < BITS_MAX {
            lens[symbol] += 1;
            free += places_of(lens[symbol]);
        }
    }
    // What that leaves free makes others shorter.
    for &symbol in order.iter().rev() {
        while places_of(lens[symbol]) <= free {
            free -= places_of(lens[symbol]);
            lens[symbol] -= 1;
        }
    }
    lens
}

/// RFC 1951, 3.2.2.
fn codes(lens: &[u8; SYMBOLS]) -> [Code; SYMBOLS] {
    let mut codes = [Code::default(); SYMBOLS];
    let mut next = 0_u32;
    for len in 1..=BITS_MAX as u32 {
        next <<= 1;
        for (code, _) in codes.iter_mut().zip(lens).filter(|(_, own)| u32::from(**own) == len) {
            *code = Code { bits: next.reverse_bits() >> (32 - len), len };
            next += 1;
        }
    }
    codes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(rows: &[Vec<u8>], histogram: &Histogram) -> usize {
        let mut compressor = Compressor::new(histogram, 0);
        for row in rows {
            compressor.write_row(row);
        }
        let stream = compressor.finish();
        assert!(fdeflate::decompress_to_vec(&stream).unwrap() == rows.concat());
        stream.len()
    }

    #[test]
    fn runs_of_all_lengths_and_bytes_come_back() {
        let bytes: Vec<u8> = (0..=255).collect();
        let rows: Vec<Vec<u8>> = (0..1200).map(|zeros| [&bytes[zeros % 9..], &vec![0; zeros], &[7]].concat()).collect();
        let mut fitted = Histogram::new();
        rows.iter().for_each(|row| fitted.add(row));
        let (fitted, plain) = (round_trip(&rows, &fitted), round_trip(&rows, &Histogram::new()));
        assert!(fitted < plain, "{fitted} {plain}");
        round_trip(&[], &Histogram::new());
        round_trip(&[vec![], vec![0; 100_000]], &Histogram::new());
    }

    #[test]
    fn codes_fill_their_places_whatever_the_counts() {
        let places = |lens: &[u8]| lens.iter().map(|len| 1 << (15 - len)).sum::<u32>();
        let mut random = 1_u32;
        for case in 0..2000_u32 {
            let mut histogram = Histogram::new();
            let shift = case % 32;
            for count in &mut histogram.0 {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Counts of all sizes, and about as many of each.
                *count = 1 + (random >> shift >> (random & 15)) / 2;
            }
            if case < 30 {
                // Few that are frequent, each twice as much as the next.
                histogram = Histogram::new();
                (0..case as usize).for_each(|i| histogram.0[i * 7] = 1 << i);
            }
            let lens = code_lens(&histogram.0);
            assert!(lens.iter().all(|&len| (1..=BITS_MAX as u8).contains(&len)), "case {case}");
            assert_eq!(places(&lens), 1 << 15, "case {case}");
        }
    }

    #[test]
    fn lengths_have_the_symbols_of_the_format() {
        // RFC 1951, 3.2.5.
        let firsts = [
            3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195,
            227, 258,
        ];
        let bits = [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0];
        for length in 3..=LENGTH_MAX {
            let i = firsts.iter().rposition(|&first| first <= length).unwrap();
            assert_eq!(length_symbol(length), (257 + i, (length - firsts[i]) as u64, bits[i]), "{length}");
        }
    }
}
