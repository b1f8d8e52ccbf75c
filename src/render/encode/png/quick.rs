//! The quick PNG encoder. It takes the rows of a picture one after the other, so that upper rows can be
//! encoded while lower ones are still being drawn. There is one filter for the whole picture, Paeth, and
//! the Huffman codes are not fitted to the picture.
//!
//! Paeth leaves of a rendering mostly runs of zeros, so trying more filters pays little. Where eight
//! pixels and the one left of them equal those above, as in the background and in flat faces, zeros are
//! written without computing anything.

use fdeflate::Compressor;
use png::{ColorType, Filter, chunk};

use super::encoder;
use crate::encode::EncodeError;
use crate::image::{Image, RowSink};

/// Bytes that are compared with the row above at a time: 8 pixels.
const BLOCK: usize = 32;

/// Encodes a picture, without alpha where every pixel is opaque.
pub fn encode(image: &Image) -> Result<Vec<u8>, EncodeError> {
    let mut png = QuickPng::new([image.width_px, image.height_px], image.is_opaque())?;
    png.compress(&image.rgba)?;
    png.file()
}

/// A PNG file whose rows come one after the other.
pub struct QuickPng {
    size_px: [u32; 2],
    /// Colours are stored without alpha.
    is_opaque: bool,
    compressor: Compressor<Vec<u8>>,
    /// The filter's number, and a row as it is compressed.
    line: Vec<u8>,
    /// The last row that came.
    above: Vec<u8>,
    rows: usize,
    /// The pixels' alphas, combined by "and": 255 if all are opaque.
    alphas: u8,
    /// The first error of a row that came by [`RowSink`].
    failed: Option<EncodeError>,
}

impl QuickPng {
    /// The beginning of a picture, which is expected to be opaque or not.
    pub fn new(size_px: [u32; 2], is_opaque: bool) -> Result<Self, EncodeError> {
        let [width, height] = size_px.map(|pixels| pixels as usize);
        let channels = if is_opaque { 3 } else { 4 };
        let mut line = vec![0; 1 + width * channels];
        line[0] = Filter::Paeth as u8;
        Ok(Self {
            size_px,
            is_opaque,
            compressor: Compressor::new(Vec::with_capacity(width * height * 4 / 8))?,
            line,
            above: vec![0; width * 4],
            rows: 0,
            alphas: 255,
            failed: None,
        })
    }

    /// The file of a picture whose upper rows have come, or none of them. The others are taken from the picture. If
    /// it is not as it was expected, it is encoded anew: the file is always that of [`encode`].
    pub fn finish(mut self, image: &Image) -> Result<Vec<u8>, EncodeError> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        if self.size_px != [image.width_px, image.height_px] {
            return encode(image);
        }
        let begun = self.rows * self.above.len();
        self.compress(image.rgba.get(begun..).unwrap_or_default())?;
        let is_as_expected = self.rows == image.height_px as usize && self.is_opaque == (self.alphas == 255);
        if is_as_expected { self.file() } else { encode(image) }
    }

    fn compress(&mut self, rgba: &[u8]) -> Result<(), EncodeError> {
        for row in rgba.chunks_exact(self.above.len()) {
            if self.is_opaque {
                filter_row::<3>(row, &self.above, &mut self.line[1..]);
            } else {
                filter_row::<4>(row, &self.above, &mut self.line[1..]);
            }
            self.compressor.write_data(&self.line)?;
            self.above.copy_from_slice(row);
            let pixels = row.as_chunks::<4>().0.iter();
            self.alphas &= (pixels.fold(!0, |all, pixel| all & u32::from_le_bytes(*pixel)) >> 24) as u8;
            self.rows += 1;
        }
        Ok(())
    }

    fn file(self) -> Result<Vec<u8>, EncodeError> {
        let data = self.compressor.finish()?;
        let mut bytes = Vec::with_capacity(data.len() + 128);
        let color = if self.is_opaque { ColorType::Rgb } else { ColorType::Rgba };
        let mut writer = encoder(&mut bytes, self.size_px, color).write_header()?;
        writer.write_chunk(chunk::IDAT, &data)?;
        writer.finish()?;
        Ok(bytes)
    }
}

impl RowSink for QuickPng {
    fn write_rows(&mut self, rgba: &[u8]) {
        if self.failed.is_none() {
            self.failed = self.compress(rgba).err();
        }
    }
}

/// Filters a row by Paeth: PNG specification, 9.2 and 9.4.
fn filter_row<const CHANNELS: usize>(row: &[u8], above: &[u8], out: &mut [u8]) {
    // Left of the first pixel are zeros.
    let (first, first_above) = (first_block(row), first_block(above));
    let blocks = row.len() / BLOCK;
    for i in 0..blocks {
        let at = i * BLOCK;
        let (Some(block), Some(block_above)) = (row[at..].first_chunk(), above[at..].first_chunk()) else { break };
        let (left, above_left) = match at.checked_sub(4) {
            Some(at) => (row[at..].first_chunk().unwrap_or(&first), above[at..].first_chunk().unwrap_or(&first_above)),
            None => (&first, &first_above),
        };
        let out = &mut out[i * BLOCK / 4 * CHANNELS..][..BLOCK / 4 * CHANNELS];
        if block == block_above && left[..4] == above_left[..4] {
            out.fill(0);
            continue;
        }
        let residuals = filter_block(block, block_above, left, above_left);
        if CHANNELS == 3 { out.copy_from_slice(&without_alpha(&residuals)) } else { out.copy_from_slice(&residuals) }
    }
    let at = |row: &[u8], i: usize, k: usize| if i == 0 { 0 } else { row[4 * (i - 1) + k] };
    for i in blocks * BLOCK / 4..row.len() / 4 {
        for k in 0..CHANNELS {
            let value = predicted(at(row, i, k), above[4 * i + k], at(above, i, k));
            out[i * CHANNELS + k] = row[4 * i + k].wrapping_sub(value);
        }
    }
}

/// Filters the bytes of a block, given those left of it, above it, and left above it.
#[inline]
fn filter_block(block: &[u8; BLOCK], above: &[u8; BLOCK], left: &[u8; BLOCK], above_left: &[u8; BLOCK]) -> [u8; BLOCK] {
    std::array::from_fn(|i| block[i].wrapping_sub(predicted(left[i], above[i], above_left[i])))
}

/// The bytes left of a row's first block, and its own but the last pixel.
fn first_block(row: &[u8]) -> [u8; BLOCK] {
    let mut block = [0; BLOCK];
    if let Some(start) = row.first_chunk::<{ BLOCK - 4 }>() {
        block[4..].copy_from_slice(start);
    }
    block
}

/// The first three of each four bytes, in whole words: byte by byte takes twice as long as the
/// filter.
#[inline]
fn without_alpha(block: &[u8; BLOCK]) -> [u8; BLOCK / 4 * 3] {
    let pairs = block.as_chunks::<8>().0.iter().map(|pair| {
        let pair = u64::from_le_bytes(*pair);
        (pair & 0xff_ffff) | ((pair >> 8) & 0xffff_ff00_0000)
    });
    let mut out = [0; BLOCK / 4 * 3];
    for (out, pair) in out.as_chunks_mut::<6>().0.iter_mut().zip(pairs) {
        out.copy_from_slice(&pair.to_le_bytes()[..6]);
    }
    out
}

/// Of the three neighbours, the one that is nearest to `left + above - above_left`; the first one
/// of equals. Bytes and masks of bytes alone, so that a vector holds many.
#[inline(always)]
fn predicted(left: u8, above: u8, above_left: u8) -> u8 {
    let mask = |is: bool| if is { 255_u8 } else { 0 };
    let (to_left, to_above) = (above.abs_diff(above_left), left.abs_diff(above_left));
    let sides_differ = mask(left < above_left) ^ mask(above < above_left);
    // With both neighbours on one side of the one above left, the distances add up: never nearest.
    let to_above_left = to_left.abs_diff(to_above) | !sides_differ;
    let is_left = mask(to_left <= to_above.min(to_above_left));
    let is_above = mask(to_above <= to_above_left);
    (left & is_left) | (((above & is_above) | (above_left & !is_above)) & !is_left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prediction_is_that_of_the_specification() {
        for i in 0..1_u32 << 24 {
            let [a, b, c, _] = i.to_le_bytes();
            let [left, above, above_left] = [a, b, c].map(i32::from);
            let p = left + above - above_left;
            let [to_left, to_above, to_above_left] = [left, above, above_left].map(|v| (p - v).abs());
            let nearest = if to_left <= to_above && to_left <= to_above_left {
                a
            } else if to_above <= to_above_left {
                b
            } else {
                c
            };
            assert_eq!(predicted(a, b, c), nearest, "{a} {b} {c}");
        }
    }

    /// The filtered rows of so many channels, without the shortcut for equal pixels.
    fn lines(image: &Image, channels: usize) -> Vec<u8> {
        let row_len = image.width_px as usize * 4;
        let at = |x: i64, y: i64| if x < 0 || y < 0 { 0 } else { image.rgba[y as usize * row_len + x as usize] };
        let mut lines = Vec::new();
        for y in 0..i64::from(image.height_px) {
            lines.push(4);
            lines.extend(
                (0..row_len as i64)
                    .filter(|x| (*x as usize) % 4 < channels)
                    .map(|x| at(x, y).wrapping_sub(predicted(at(x - 4, y), at(x, y - 1), at(x - 4, y - 1)))),
            );
        }
        lines
    }

    #[test]
    fn equal_pixels_filter_to_zeros_without_being_looked_at() {
        for width_px in [1, 7, 8, 9, 16, 17, 40] {
            for changed in 0..width_px * 4 {
                // Equal rows but for one byte, which is another one in each picture.
                let mut rgba: Vec<u8> = (0..width_px * 4).map(|i| (i * 7 % 11) as u8).collect::<Vec<_>>().repeat(3);
                rgba[(width_px * 4 + changed) as usize] ^= 5;
                let image = Image { width_px, height_px: 3, rgba: rgba.into() };
                for (channels, is_opaque) in [(3, true), (4, false)] {
                    let mut png = QuickPng::new([width_px, 3], is_opaque).unwrap();
                    png.compress(&image.rgba).unwrap();
                    let filtered = fdeflate::decompress_to_vec(&png.compressor.finish().unwrap()).unwrap();
                    assert_eq!(filtered, lines(&image, channels), "{width_px} {changed} {channels}");
                }
            }
        }
    }

    /// Opaque and transparent pictures, each expected to be either, with any number of rows that come before the
    /// end.
    #[test]
    fn rows_that_come_early_change_no_byte() {
        let mut cases = 0;
        for transparent in [None, Some(0), Some(9), Some(19)] {
            let mut image = Image { width_px: 9, height_px: 20, rgba: vec![255; 9 * 20 * 4].into() };
            for (i, byte) in image.rgba.iter_mut().enumerate().filter(|(i, _)| i % 4 < 3) {
                *byte = (i * i % 251) as u8;
            }
            if let Some(row) = transparent {
                image.rgba[row * 36 + 7] = 3;
            }
            let wanted = encode(&image).unwrap();
            for (is_opaque, early) in [(true, 0), (true, 7), (true, 20), (false, 0), (false, 7), (false, 20)] {
                let mut png = QuickPng::new([9, 20], is_opaque).unwrap();
                image.rgba.chunks(36).take(early).for_each(|row| png.write_rows(row));
                assert_eq!(png.rows, early);
                assert!(png.finish(&image).unwrap() == wanted, "{transparent:?} {is_opaque} {early}");
                cases += 1;
            }
        }
        assert_eq!(cases, 24);
    }

    #[test]
    fn a_picture_of_another_size_and_rows_that_came_twice_are_encoded_anew() {
        let image = Image { width_px: 4, height_px: 5, rgba: (0..80).collect() };
        for (size_px, times) in [([4, 4], 1), ([5, 4], 1), ([4, 5], 2)] {
            let mut png = QuickPng::new(size_px, false).unwrap();
            (0..times).for_each(|_| png.write_rows(&image.rgba[..64]));
            assert!(png.finish(&image).unwrap() == encode(&image).unwrap(), "{size_px:?}");
        }
    }
}
