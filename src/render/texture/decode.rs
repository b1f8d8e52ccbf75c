//! The decoding of texture images (PNG, JPEG, WebP and others): from the bytes of a file to rows of
//! linear texels.
//!
//! A decoder cannot be stopped midway. Its time is bounded by the pixels that the budget allows and by
//! the input's length: PNG, WebP and baseline JPEG are read once. A progressive JPEG's scans go over all
//! pixels again, and zune-jpeg refuses more than 100 scans.

use std::io::{BufRead, Cursor, Seek};

use crate::guard::{Panicked, guarded};
use crate::srgb::srgb_to_linear;
use crate::texture::TextureError;
use crate::texture::basis::{self, BasisHeader, KTX2_MAGIC};
use crate::texture::png::CriticalChunks;
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, ImageResult, Limits};

/// The size of an image and the cost of decoding it, from its first bytes.
#[derive(Clone, Copy, Debug)]
pub struct Header {
    encoding: Encoding,
    /// Columns, texels.
    pub width: u32,
    /// Rows, texels.
    pub height: u32,
    /// Memory that decoding takes, the result included.
    pub decoding_bytes: u64,
}

/// The decoder that an image needs.
#[derive(Clone, Copy, Debug)]
enum Encoding {
    /// One that the `image` crate reads.
    Picture(ImageFormat),
    /// Basis Universal in KTX2.
    Basis(BasisHeader),
}

/// Decoded pixels, with the channels and the depth that the file has.
#[derive(Debug)]
pub struct Pixels {
    /// Columns, texels.
    pub width: u32,
    /// Rows, texels.
    pub height: u32,
    /// 1: grey, 2: grey and alpha, 3: RGB, 4: RGB and alpha.
    pub channels: usize,
    /// True if a channel has 16 bits, in the machine's byte order; false if it has 8.
    pub is_wide: bool,
    bytes: Vec<u8>,
}

/// The linear value of each number that a channel can hold, as `T`.
#[derive(Debug)]
pub struct LookupTable<T> {
    color: Vec<T>,
    alpha: Vec<T>,
}

/// Memory that a decoder may take beside what the budget paid: a row of half a million pixels, and
/// tables.
const ALLOWANCE_BYTES: u64 = 4 << 20;

/// Reads the header alone. `name` is the image's, for errors.
pub fn header(name: &str, bytes: &[u8]) -> Result<Header, TextureError> {
    guarded("image", || read_header(name, bytes)).map_err(|panicked| failed(name, panicked))?
}

fn read_header(name: &str, bytes: &[u8]) -> Result<Header, TextureError> {
    if bytes.starts_with(KTX2_MAGIC) {
        let basis = basis::header(name, bytes)?;
        let BasisHeader { width, height, decoding_bytes } = basis;
        return Ok(Header { encoding: Encoding::Basis(basis), width, height, decoding_bytes });
    }
    let format = sniff(bytes).ok_or_else(|| {
        let known = "a PNG, a JPEG, a WebP, a KTX2, a BMP, a DDS nor a TGA image";
        TextureError::Unsupported(format!("{name} of the mesh is neither {known}"))
    })?;
    let encoding = Encoding::Picture(format);
    let decoder = match (open(bytes, format, ALLOWANCE_BYTES), png_size(bytes)) {
        (Ok(decoder), _) => decoder,
        // A single row exceeds the allowance. The caller refuses the size with a better sentence.
        (Err(ImageError::Limits(_)), Some([width, height])) if format == ImageFormat::Png => {
            return Ok(Header { encoding, width, height, decoding_bytes: u64::MAX });
        }
        (Err(error), _) => return Err(fault(name, &error)),
    };
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(TextureError::Broken(format!("{name} of the mesh has no pixels")));
    }
    kind(name, decoder.color_type())?;
    // Beside the result, JPEG keeps 16-bit coefficients and WebP its planes; both copy the input.
    let times = if format == ImageFormat::Png { 1 } else { 4 };
    let decoding_bytes = decoder.total_bytes().saturating_mul(times).saturating_add(bytes.len() as u64);
    Ok(Header { encoding, width, height, decoding_bytes })
}

/// Decodes all pixels. The caller has spent [`Header::decoding_bytes`].
pub fn decode(name: &str, bytes: &[u8], header: &Header) -> Result<Pixels, TextureError> {
    guarded("pixels", || read_pixels(name, bytes, header)).map_err(|panicked| failed(name, panicked))?
}

fn failed(name: &str, panicked: Panicked) -> TextureError {
    TextureError::Broken(format!("{name} of the mesh cannot be decoded: {panicked}"))
}

fn read_pixels(name: &str, bytes: &[u8], header: &Header) -> Result<Pixels, TextureError> {
    let format = match &header.encoding {
        Encoding::Picture(format) => *format,
        Encoding::Basis(basis) => {
            let bytes = basis::decode(name, bytes, basis)?;
            return Ok(Pixels { width: basis.width, height: basis.height, channels: 4, is_wide: false, bytes });
        }
    };
    let limit_bytes = header.decoding_bytes.saturating_add(ALLOWANCE_BYTES);
    let decoder = open(bytes, format, limit_bytes).map_err(|error| fault(name, &error))?;
    let (width, height) = decoder.dimensions();
    let (channels, is_wide) = kind(name, decoder.color_type())?;
    let mut pixels = vec![0; decoder.total_bytes() as usize];
    decoder.read_image(&mut pixels).map_err(|error| fault(name, &error))?;
    Ok(Pixels { width, height, channels, is_wide, bytes: pixels })
}

impl Header {
    /// The encoding's name: `png`, `ktx2`.
    pub fn encoding_name(&self) -> &'static str {
        match &self.encoding {
            Encoding::Picture(format) => format.extensions_str().first().copied().unwrap_or_default(),
            Encoding::Basis(_) => "ktx2",
        }
    }
}

impl Pixels {
    /// Writes row `y` to `out` as straight RGBA.
    pub fn row<T: Copy>(&self, y: u32, table: &LookupTable<T>, out: &mut [[T; 4]]) {
        let stride = self.width as usize * self.channels * if self.is_wide { 2 } else { 1 };
        let row = &self.bytes[y as usize * stride..][..stride];
        // A loop for each kind of pixel, in which nothing is decided any more.
        match (self.channels, self.is_wide) {
            (1, false) => narrow::<T, 1>(row, table, out),
            (2, false) => narrow::<T, 2>(row, table, out),
            (3, false) => narrow::<T, 3>(row, table, out),
            (_, false) => narrow::<T, 4>(row, table, out),
            (1, true) => wide::<T, 1>(row, table, out),
            (2, true) => wide::<T, 2>(row, table, out),
            (3, true) => wide::<T, 3>(row, table, out),
            (_, true) => wide::<T, 4>(row, table, out),
        }
    }

    /// True if the file has an alpha channel.
    pub fn has_alpha(&self) -> bool {
        self.channels.is_multiple_of(2)
    }

    /// The table for these pixels. Colours are stored as sRGB if `is_color`; else they, like alpha
    /// always, are linear. `of` converts a linear value.
    pub fn lookup_table<T>(&self, is_color: bool, of: impl Fn(f32) -> T) -> LookupTable<T> {
        let largest = if self.is_wide { 65535 } else { 255 };
        let alpha = |v: u32| f64::from(v) / f64::from(largest);
        let color = |v: u32| if is_color { srgb_to_linear(alpha(v)) } else { alpha(v) };
        LookupTable {
            color: (0..=largest).map(|v| of(color(v) as f32)).collect(),
            alpha: (0..=largest).map(|v| of(alpha(v) as f32)).collect(),
        }
    }
}

/// A row of 8 bits per channel.
fn narrow<T: Copy, const CHANNELS: usize>(row: &[u8], table: &LookupTable<T>, out: &mut [[T; 4]]) {
    for (pixel, out) in row.as_chunks::<CHANNELS>().0.iter().zip(out) {
        *out = table.texel(pixel.map(usize::from));
    }
}

/// A row of 16 bits per channel.
fn wide<T: Copy, const CHANNELS: usize>(row: &[u8], table: &LookupTable<T>, out: &mut [[T; 4]]) {
    for (pixel, out) in row.as_chunks::<2>().0.as_chunks::<CHANNELS>().0.iter().zip(out) {
        *out = table.texel(pixel.map(|number| u16::from_ne_bytes(number).into()));
    }
}

impl<T: Copy> LookupTable<T> {
    /// The texel of a pixel: grey, grey and alpha, RGB, or RGB and alpha.
    #[inline]
    fn texel<const CHANNELS: usize>(&self, pixel: [usize; CHANNELS]) -> [T; 4] {
        let color = |channel: usize| self.color[pixel[channel]];
        let opaque = self.alpha[self.alpha.len() - 1];
        match CHANNELS {
            1 => [color(0), color(0), color(0), opaque],
            2 => [color(0), color(0), color(0), self.alpha[pixel[1]]],
            3 => [color(0), color(1), color(2), opaque],
            _ => [color(0), color(1), color(2), self.alpha[pixel[3]]],
        }
    }
}

fn sniff(bytes: &[u8]) -> Option<ImageFormat> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some(ImageFormat::Png)
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        Some(ImageFormat::Jpeg)
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        Some(ImageFormat::WebP)
    } else if bytes.starts_with(b"DDS ") {
        Some(ImageFormat::Dds)
    } else if bytes.starts_with(b"BM") {
        Some(ImageFormat::Bmp)
    } else if is_tga(bytes) {
        Some(ImageFormat::Tga)
    } else {
        None
    }
}

/// True for a TGA header. It has no magic number, but few other bytes make sense as one. Truevision TGA File
/// Format Specification 2.0: type of the colour map, type of the image, bits per pixel, and two reserved
/// bits.
fn is_tga(bytes: &[u8]) -> bool {
    let Some(&[_, map, kind, .., bits, descriptor]) = bytes.first_chunk::<18>() else { return false };
    let is_mapped = matches!(kind, 1 | 9);
    let is_kind = is_mapped || matches!(kind, 2 | 3 | 10 | 11);
    is_kind && map <= 1 && (map == 1 || !is_mapped) && matches!(bits, 8 | 15 | 16 | 24 | 32) && descriptor >> 6 == 0
}

/// Channels, and whether they have 16 bits.
fn kind(name: &str, color_type: ColorType) -> Result<(usize, bool), TextureError> {
    Ok(match color_type {
        ColorType::L8 => (1, false),
        ColorType::La8 => (2, false),
        ColorType::Rgb8 => (3, false),
        ColorType::Rgba8 => (4, false),
        ColorType::L16 => (1, true),
        ColorType::La16 => (2, true),
        ColorType::Rgb16 => (3, true),
        ColorType::Rgba16 => (4, true),
        other => {
            let detail = format!("{name} of the mesh has pixels of an unknown kind ({other:?})");
            return Err(TextureError::Unsupported(detail));
        }
    })
}

/// A decoder that may allocate `limit_bytes` beside its result.
fn open(bytes: &[u8], format: ImageFormat, limit_bytes: u64) -> ImageResult<Box<dyn ImageDecoder + '_>> {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(limit_bytes);
    match format {
        ImageFormat::Png => limited(CriticalChunks::new(bytes), format, limits),
        _ => limited(Cursor::new(bytes), format, limits),
    }
}

/// Width and height from a PNG's first chunk.
fn png_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let number = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let size = [number(16)?, number(20)?];
    (bytes.get(12..16)? == b"IHDR" && !size.contains(&0)).then_some(size)
}

fn limited<'b>(
    input: impl BufRead + Seek + 'b,
    format: ImageFormat,
    limits: Limits,
) -> ImageResult<Box<dyn ImageDecoder + 'b>> {
    let mut reader = ImageReader::with_format(input, format);
    reader.limits(limits);
    Ok(Box::new(reader.into_decoder()?))
}

/// The decoder's message can quote the file, so control characters and length are cut.
fn fault(name: &str, error: &ImageError) -> TextureError {
    let why: String = error.to_string().chars().filter(|c| !c.is_control()).take(200).collect();
    let detail = format!("{name} of the mesh cannot be decoded: {why}");
    match error {
        ImageError::Unsupported(_) => TextureError::Unsupported(detail),
        _ => TextureError::Broken(detail),
    }
}
