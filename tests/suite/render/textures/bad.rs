//! Images that are broken or huge. A broken image is a warning that names it. A huge one is refused
//! by its header, before memory is allocated for its pixels. Chunks beside the pixels cost nothing.

use crate::support::work::within_bytes;
use image::ImageFormat;
use meshsnap_render::limits::Limits;
use meshsnap_render::plan::{PlanError, SkipKind};

use crate::render::textures::levels::{encode, error, model_of, noise, plan_of, textures, warning};
use crate::support::files::mesh::Noise;
use crate::support::scenes;

pub fn header(width: u32, height: u32, depth: u8, color: u8) -> Vec<u8> {
    [&width.to_be_bytes()[..], &height.to_be_bytes(), &[depth, color, 0, 0, 0]].concat()
}

pub fn png(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, data) in chunks.iter().copied().chain([(b"IEND", &[][..])]) {
        out.extend((data.len() as u32).to_be_bytes());
        let body = [&kind[..], data].concat();
        let mut crc = u32::MAX;
        for byte in &body {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
            }
        }
        out.extend(body);
        out.extend((!crc).to_be_bytes());
    }
    out
}

/// Stored, not compressed.
pub fn zlib(data: &[u8]) -> Vec<u8> {
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in data {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    let length = data.len() as u16;
    [&[0x78, 1, 1][..], &length.to_le_bytes(), &(!length).to_le_bytes(), data, &(b << 16 | a).to_be_bytes()].concat()
}

#[test]
fn broken_images_are_named() {
    let good = encode(&image::RgbImage::from_raw(16, 16, noise(16, 16, 3, 5)).unwrap().into(), ImageFormat::Png);
    let mut flipped = good.clone();
    flipped[40] ^= 0x55;
    let cases = [
        (good[..good.len() / 2].to_vec(), "image 0 of the mesh cannot be decoded"),
        (good[..30].to_vec(), "image 0 of the mesh cannot be decoded"),
        (flipped, "image 0 of the mesh cannot be decoded"),
        (b"GIF89a and so on".to_vec(), "image 0 of the mesh is neither a PNG, a JPEG, a WebP, a KTX2, a BMP, a DDS"),
        (vec![0], "neither a PNG"),
        (b"\xff\xd8\xff\xe0 no JPEG".to_vec(), "cannot be decoded"),
        (b"RIFF\0\0\0\0WEBPVP8 no".to_vec(), "cannot be decoded"),
        (png(&[(b"IHDR", &header(0, 5, 8, 2))]), "image 0 of the mesh"),
    ];
    for (bytes, part) in &cases {
        let mesh = model_of(bytes);
        let sentence = warning(&mesh);
        assert!(sentence.contains(part), "{sentence}");
        // A look that does not sample it never looks at it.
        let spec = scenes::spec(&[("style", "smooth"), ("surface.color", "888")]);
        let plan = scenes::plan(&mesh, &spec);
        assert!(plan.surface.unwrap().textures.images.is_empty());
    }
    assert_eq!(cases.len(), 8);
    // No bytes may panic.
    let mut noise = Noise(99);
    for _ in 0..300 {
        let mut bytes = good.clone();
        for _ in 0..3 {
            let at = 8 + noise.next() as usize % (bytes.len() - 8);
            bytes[at] = noise.next() as u8;
        }
        let _ = plan_of(&model_of(&bytes), &[], &Limits::default());
    }
}

/// Bytes that may be allocated for a small mesh and a picture that is not decoded.
const UNDECODED_MAX: u64 = 2 << 20;

#[test]
fn sizes_are_checked_before_anything_is_decoded() {
    let bomb = png(&[(b"IHDR", &header(30_000, 30_000, 8, 6)), (b"IDAT", &zlib(&[0; 900]))]);
    assert!(bomb.len() < 1024);
    let mesh = model_of(&bomb);
    let PlanError::Limit(limit) = within_bytes(UNDECODED_MAX, "a huge picture", || error(&mesh)) else {
        panic!("no limit")
    };
    assert_eq!((limit.flag, limit.given, limit.limit), ("--limit-texture-px", 30_000, 8192));
    assert!(limit.to_string().contains("image 0"), "{limit}");
    // Of these, a row alone is more than a decoder may have.
    let sizes = [[1 << 31, 1], [(1 << 31) - 1, 1], [(1 << 31) - 1, (1 << 31) - 1], [700_000, 4]];
    let mut named = 0;
    for [width, height] in sizes {
        let wide = model_of(&png(&[(b"IHDR", &header(width, height, 16, 6)), (b"IDAT", &zlib(&[0; 900]))]));
        let PlanError::Limit(limit) = error(&wide) else { panic!("{width}x{height}: {}", error(&wide)) };
        assert_eq!((limit.flag, limit.given), ("--limit-texture-px", u64::from(width.max(height))));
        // Where such a texture is allowed, it is its memory that is not.
        let vast = Limits::default().with(|limits| {
            limits.texture_px = u64::MAX;
            limits.texture_total_px = u64::MAX;
        });
        assert!(
            matches!(plan_of(&wide, &[], &vast), Err(PlanError::Limit(limit)) if limit.flag == "--limit-memory-bytes")
        );
        named += 1;
    }
    assert_eq!(named, 4);

    let picture = encode(&image::RgbImage::new(100, 50).into(), ImageFormat::Png);
    let flag = |limits: Limits| {
        let mesh = model_of(&picture);
        plan_of(&mesh, &[], &limits).map(|_| ()).map_err(|e| match e {
            PlanError::Limit(limit) => limit.flag,
            other => panic!("{other}"),
        })
    };
    let usual = Limits::default();
    assert_eq!(
        flag(usual.clone().with(|limits| {
            limits.texture_px = 100;
            limits.texture_total_px = 5000;
        })),
        Ok(())
    );
    assert_eq!(flag(usual.clone().with(|limits| limits.texture_px = 99)), Err("--limit-texture-px"));
    assert_eq!(flag(usual.clone().with(|limits| limits.texture_total_px = 4999)), Err("--limit-texture-total-px"));
    assert_eq!(flag(usual.with(|limits| limits.memory_bytes = 100_000)), Err("--limit-memory-bytes"));

    // Within the limits, and not paid for.
    let large = png(&[(b"IHDR", &header(8000, 8000, 16, 6)), (b"IDAT", &zlib(&[0; 900]))]);
    let mesh = model_of(&large);
    let small = Limits::default().with(|limits| limits.memory_bytes = 256 << 20);
    let planned = within_bytes(UNDECODED_MAX, "a large picture", || plan_of(&mesh, &[], &small).map(drop));
    assert!(matches!(planned, Err(PlanError::Limit(_))));
}

/// Whatever is not pixels is passed over: a colour profile that inflates to 80 MiB, and text of 6
/// MiB, which is more than the decoder may take before it is paid.
#[test]
fn chunks_beside_the_pixels_cost_nothing() {
    // Deflate's fixed codes: a zero, then copies of 258 bytes from a distance of 1, which are 13
    // bits, twelve zero.
    let mut bits = vec![true, true, false];
    bits.extend([false, false, true, true, false, false, false, false]);
    for _ in 0..(80 << 20) / 258 {
        bits.extend([true, true, false, false, false, true, false, true]);
        bits.extend([false; 5]);
    }
    bits.extend([false; 7]);
    let packed = bits.chunks(8).map(|byte| byte.iter().rev().fold(0, |sum, &bit| sum << 1 | u8::from(bit)));
    let profile: Vec<u8> = b"p\0\0\x78\x01".iter().copied().chain(packed).collect();
    let text = [b"Comment\0", &vec![b'x'; 6 << 20][..]].concat();
    let (header, row) = (header(2, 1, 8, 0), zlib(&[0, 255, 0]));
    let plain = png(&[(b"IHDR", &header), (b"IDAT", &row)]);
    let mut cases = 0;
    let want = textures(&model_of(&plain));
    for (kind, data) in [(b"iCCP", &profile), (b"tEXt", &text), (b"eXIf", &text), (b"tIME", &text)] {
        let picture = png(&[(b"IHDR", &header), (kind, data), (b"IDAT", &row)]);
        let mesh = model_of(&picture);
        // Far too little for what they hold.
        let limits = Limits::default().with(|limits| limits.memory_bytes = 16 << 20);
        let plan = plan_of(&mesh, &[SkipKind::FineTextureLevels], &limits).unwrap();
        assert_eq!(plan.surface.unwrap().textures.images[0].texels[..], want.images[0].texels[..]);
        cases += 1;
    }
    assert_eq!(cases, 4);
    // Chunks that the pixels need are kept.
    let clear = png(&[(b"IHDR", &header), (b"tRNS", &[0, 255]), (b"IDAT", &row)]);
    assert_eq!(textures(&model_of(&clear)).images[0].texels[..2], [[0x3c00, 0x3c00, 0x3c00, 0], [0, 0, 0, 0x3c00]]);
}
