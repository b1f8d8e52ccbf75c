//! Basis Universal textures in KTX2: both codecs show what was encoded, and a warning names an
//! image that is damaged or of another kind.

use crate::render::textures::levels::{model_of, textures, value, warning};
use crate::support::data;
use crate::support::files::mesh::Noise;
use crate::support::work::within_bytes;
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::plan::PlanError;

/// Pictures of 40 x 40 texels that say of themselves what they are: BASIS over ETC1S, and BASIS
/// over UASTC, in the same colours; and one that is not of Basis Universal.
fn pictures() -> [Vec<u8>; 3] {
    ["2d_rgba8.ktx2", "2d_etc1s.ktx2", "2d_uastc.ktx2"].map(|name| data::bytes(&format!("models/ktx2/{name}")))
}

fn put(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Rows 3 to 10 of both.
const BASIS: [&str; 8] = [
    "...####.....#.....###...#####...###.....",
    "...#...#...#.#...#...#....#....#...#....",
    "...#...#..#...#..#........#....#........",
    "...####...#...#...###.....#.....###.....",
    "...#...#..#####......#....#........#....",
    "...#...#..#...#......#....#........#....",
    "...#...#..#...#..#...#....#....#...#....",
    "...####...#...#...###...#####...###.....",
];

/// Row 14 of the one and the other, where they say what they are.
const ETC1S_TOP: &str = "...#####..#####...###.....#.....###.....";
const UASTC_TOP: &str = "...#...#....#.....###...#####...###.....";

#[test]
fn both_codecs_show_what_was_encoded() {
    let [_, etc1s, uastc] = pictures();
    for (bytes, top) in [(etc1s, ETC1S_TOP), (uastc, UASTC_TOP)] {
        let textures = textures(&model_of(&bytes));
        let image = &textures.images[0];
        assert_eq!((image.width, image.height), (40, 40));
        // Linear, as textures are kept: letters are nearly white, and the ground has no blue.
        let texel = |x: usize, y: usize| image.texels[y * 40 + x].map(value);
        let row = |y: usize| (0..40).map(|x| if texel(x, y)[2] > 0.15 { '#' } else { '.' }).collect::<String>();
        let rows: Vec<String> = (0..40).map(row).collect();
        assert_eq!(rows[3..11], BASIS);
        assert_eq!(rows[14], top);
        assert!(rows[..3].iter().chain(&rows[22..]).all(|row| !row.contains('#')));
        assert!((0..1600).all(|i| texel(i % 40, i / 40)[3] == 1.0));
    }
}

#[test]
fn other_ktx2_files_are_named() {
    let [plain, etc1s, uastc] = pictures();
    let with = |bytes: &[u8], at: usize, value: u32| {
        let mut bytes = bytes.to_vec();
        put(&mut bytes, at, value);
        bytes
    };
    let cases = [
        (plain, "not of Basis Universal"),
        (etc1s[..40].to_vec(), "cut off"),
        (etc1s[..400].to_vec(), "cannot be transcoded"),
        (with(&etc1s, 44, 3), "not of Basis Universal"),
        (with(&etc1s, 20, 0), "not one flat picture"),
        (with(&etc1s, 28, 2), "not one flat picture"),
        (with(&etc1s, 32, u32::MAX), "not one flat picture"),
        (with(&etc1s, 36, 6), "not one flat picture"),
        (with(&etc1s, 40, 17), "cannot be transcoded"),
        (with(&etc1s, 64, u32::MAX), "cannot be transcoded"),
        (with(&with(&uastc, 44, 2), 96, 1616), "unpacks to 1616 bytes"),
    ];
    let mut ran = 0;
    for (bytes, word) in cases {
        let detail = warning(&model_of(&bytes));
        assert!(detail.contains("image 0") && detail.contains(word), "{word}: {detail}");
        ran += 1;
    }
    assert_eq!(ran, 11);
    // Paid for, pixel by pixel, before it is decoded.
    for (side, limit) in [(8193, "--limit-texture-px"), (8192, "--limit-texture-total-px")] {
        let mut bytes = etc1s.clone();
        put(&mut bytes, 20, side);
        put(&mut bytes, 24, side);
        let mesh = model_of(&bytes);
        let limits = Limits::default().with(|limits| limits.texture_total_px = 8192 * 8191);
        let spec = crate::support::scenes::spec(&[("style", "smooth"), ("size", "64")]);
        let error = crate::support::scenes::try_plan(&mesh, &spec, &limits, &Deadline::default(), &[]).unwrap_err();
        assert!(matches!(&error, PlanError::Limit(over) if over.flag == limit), "{error}");
    }
}

#[test]
fn damaged_textures_are_refused_or_drawn() {
    let [_, etc1s, uastc] = pictures();
    let (mut noise, mut cases) = (Noise(3), 0);
    for whole in [etc1s, uastc] {
        for _ in 0..500 {
            let mut bytes = whole.clone();
            for _ in 0..1 + noise.next() % 4 {
                // The magic stays, or it would be nothing at all.
                let at = 12 + (noise.next() as usize) % (bytes.len() - 12);
                bytes[at] = (noise.next() >> 8) as u8;
            }
            let mesh = model_of(&bytes);
            let limits = Limits::default();
            let spec = crate::support::scenes::spec(&[("style", "smooth"), ("size", "16")]);
            let build = || drop(crate::support::scenes::try_plan(&mesh, &spec, &limits, &Deadline::default(), &[]));
            within_bytes(limits.memory_bytes, "a damaged texture", build);
            cases += 1;
        }
    }
    assert_eq!(cases, 1000);
}
