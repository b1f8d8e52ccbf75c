//! Format and size of an encoded image, from its header alone. Nothing is decoded and nothing
//! allocated.

/// The format and the size that an image's first bytes state; None where they state none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImageHeader {
    /// `png`, `jpeg`, `webp` or `ktx2`.
    pub format: Option<&'static str>,
    /// Columns and rows.
    pub size_px: Option<[u32; 2]>,
}

/// Reads the header of an image.
pub fn read(bytes: &[u8]) -> ImageHeader {
    let is_webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    let (format, size_px) = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        ("png", png(bytes))
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        ("jpeg", jpeg(bytes))
    } else if is_webp {
        ("webp", webp(bytes))
    } else if bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n") {
        ("ktx2", ktx2(bytes))
    } else {
        return ImageHeader::default();
    };
    ImageHeader { format: Some(format), size_px: size_px.filter(|size| !size.contains(&0)) }
}

/// The size of a PNG. ISO/IEC 15948, 11.2.2: IHDR is the first chunk.
fn png(bytes: &[u8]) -> Option<[u32; 2]> {
    (bytes.get(12..16)? == b"IHDR").then_some(())?;
    Some([u32::from_be_bytes(at(bytes, 16)?), u32::from_be_bytes(at(bytes, 20)?)])
}

/// The size of a JPEG. ITU-T T.81, B.1.1 and B.2.2: segments with their lengths, up to the one that
/// begins a frame.
fn jpeg(bytes: &[u8]) -> Option<[u32; 2]> {
    let mut rest = bytes.get(2..)?;
    loop {
        // Any number of 0xFF may fill the space before a marker.
        rest = rest.strip_prefix(b"\xff")?;
        let (&marker, after) = rest.split_first()?;
        match marker {
            0xff => {}
            0x01 | 0xd0..=0xd7 => rest = after,
            0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => {
                let [height, width] = [u16::from_be_bytes(at(after, 3)?), u16::from_be_bytes(at(after, 5)?)];
                return Some([u32::from(width), u32::from(height)]);
            }
            // A scan begins or the image ends before any frame header.
            0xd8..=0xda => return None,
            _ => rest = after.get(usize::from(u16::from_be_bytes(at(after, 0)?)).max(2)..)?,
        }
    }
}

/// The size of a WebP. RFC 9649, 2.5 to 2.7.
fn webp(bytes: &[u8]) -> Option<[u32; 2]> {
    match bytes.get(12..16)? {
        b"VP8 " => {
            (bytes.get(23..26)? == b"\x9d\x01\x2a").then_some(())?;
            let side = |at_byte| Some(u32::from(u16::from_le_bytes(at(bytes, at_byte)?) & 0x3fff));
            Some([side(26)?, side(28)?])
        }
        b"VP8L" => {
            (bytes.get(20) == Some(&0x2f)).then_some(())?;
            let bits = u32::from_le_bytes(at(bytes, 21)?);
            Some([(bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1])
        }
        b"VP8X" => {
            let side = |at_byte| at(bytes, at_byte).map(|[a, b, c]| u32::from_le_bytes([a, b, c, 0]) + 1);
            Some([side(24)?, side(27)?])
        }
        _ => None,
    }
}

/// The size of a KTX2. KTX File Format 2.0, 3: pixelWidth and pixelHeight.
fn ktx2(bytes: &[u8]) -> Option<[u32; 2]> {
    Some([u32::from_le_bytes(at(bytes, 20)?), u32::from_le_bytes(at(bytes, 24)?)])
}

/// The `N` bytes from `start` on.
fn at<const N: usize>(bytes: &[u8], start: usize) -> Option<[u8; N]> {
    bytes.get(start..)?.first_chunk().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{ExtendedColorType, ImageFormat, RgbImage};
    use std::io::Cursor;

    fn encoded(width: u32, height: u32, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::new(width, height).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn sizes_are_those_that_were_encoded() {
        let mut files = 0;
        for [width, height] in [[1, 1], [3, 2], [640, 17], [2, 1300]] {
            for (format, name) in [(ImageFormat::Png, "png"), (ImageFormat::Jpeg, "jpeg"), (ImageFormat::WebP, "webp")]
            {
                let bytes = encoded(width, height, format);
                let expected = ImageHeader { format: Some(name), size_px: Some([width, height]) };
                assert_eq!(read(&bytes), expected);
                // A truncated file gives the same size or none.
                for end in 0..bytes.len().min(700) {
                    let size = read(&bytes[..end]).size_px;
                    assert!(size.is_none() || size == expected.size_px, "{name} {end}");
                }
                files += 1;
            }
        }
        assert_eq!(files, 12);
    }

    #[test]
    fn lossy_and_extended_webp_ktx2_and_padded_jpeg() {
        let lossy = b"RIFF\x24\0\0\0WEBPVP8 \x18\0\0\0\x30\x01\0\x9d\x01\x2a\x40\x41\x30\0";
        assert_eq!(read(lossy).size_px, Some([320, 48]));
        let extended = b"RIFF\x24\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0\xff\x0f\0\x02\0\0";
        assert_eq!(read(extended).size_px, Some([4096, 3]));
        let mut ktx2 = b"\xabKTX 20\xbb\r\n\x1a\n\0\0\0\0\x01\0\0\0".to_vec();
        ktx2.extend([64, 0, 0, 0, 32, 0, 0, 0]);
        assert_eq!(read(&ktx2), ImageHeader { format: Some("ktx2"), size_px: Some([64, 32]) });
        let mut jpeg = Vec::new();
        JpegEncoder::new(&mut jpeg).encode(&[0; 12], 2, 2, ExtendedColorType::Rgb8).unwrap();
        let padded = [b"\xff\xd8\xff\xff\xff\xe1\0\x04AB", &jpeg[2..]].concat();
        assert_eq!(read(&padded).size_px, Some([2, 2]));
    }

    #[test]
    fn noise_has_no_size() {
        let cases: [&[u8]; 7] = [
            b"",
            b"GIF89a",
            b"\xff\xd8\xff",
            b"\xff\xd8\xff\xe0\0\0\xff\xe0\0\0\xff\xda",
            b"\x89PNG\r\n\x1a\n",
            b"RIFF\0\0\0\0WEBPVP9 \0\0\0\0",
            b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\0\0\0\0\x05",
        ];
        for bytes in cases {
            assert_eq!(read(bytes).size_px, None);
        }
        // A million fill bytes do not loop for ever.
        let fill = [b"\xff\xd8".as_slice(), &vec![0xff; 1_000_000]].concat();
        assert_eq!(read(&fill).size_px, None);
    }
}
