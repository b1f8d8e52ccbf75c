//! Tests of the comparison of pictures, on pictures whose differences are known. FLIP is compared with the figures
//! that the program of its authors gives.

use super::*;

fn picture(width_px: u32, pixels: &[[u8; 4]]) -> Picture {
    let bytes = pixels.as_flattened().to_vec();
    let image = image::RgbaImage::from_raw(width_px, pixels.len() as u32 / width_px, bytes).unwrap();
    let mut png = Vec::new();
    image.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
    Picture::read(&png, sniff(&png).unwrap(), &Limits::default()).unwrap()
}

const GREY: [u8; 4] = [100, 100, 100, 255];

#[test]
fn pixels_that_differ_are_counted_and_found() {
    let mut pixels = [GREY; 12];
    let a = picture(4, &pixels);
    assert_eq!(compare(&a, &a, Tolerance::default()).summary, ["no pixel differs"]);
    (pixels[5], pixels[11]) = ([100, 102, 100, 255], [100, 100, 110, 255]);
    let b = picture(4, &pixels);
    let found = compare(&a, &b, Tolerance::default());
    let numbers = found.pixels.unwrap();
    assert_eq!((numbers.differ, numbers.total, numbers.max), (2, 12, 10.0));
    assert_eq!((numbers.mean, numbers.bounds_px), (1.0, Some([[1, 1], [3, 2]])));
    let sentence = "2 pixels differ of 12 (16.7 %), by up to 10 of 255, within (1, 1) to (3, 2); FLIP 0.";
    assert!(found.summary[0].starts_with(sentence), "{:?}", found.summary);
    let is_same = |pixels, error| compare(&a, &b, Tolerance { pixels: Some(pixels), error, flip: None }).same;
    assert!(!is_same(0, 0.0) && !is_same(1, 0.0) && is_same(2, 0.0));
    assert!(!is_same(0, 2.0) && is_same(1, 2.0) && is_same(0, 10.0));
    let heat = heat(&a, &b, Tolerance { error: 2.0, ..Tolerance::default() }).unwrap();
    let is_colored = |i: usize| heat.rgba[4 * i] != heat.rgba[4 * i + 1];
    assert!((0..12).all(|i| is_colored(i) == (i == 11)));
}

#[test]
fn what_is_transparent_has_no_colour() {
    let clear = |red| picture(1, &[[red, 0, 0, 0]]);
    assert!(compare(&clear(0), &clear(255), Tolerance::default()).same);
    let half = compare(&picture(1, &[[255, 0, 0, 128]]), &picture(1, &[[0, 0, 0, 128]]), Tolerance::default());
    assert_eq!(half.pixels.unwrap().max.round(), 128.0);
    assert!(!compare(&clear(0), &picture(1, &[[0, 0, 0, 255]]), Tolerance::default()).same);
}

#[test]
fn other_sizes_and_what_is_no_picture_are_told() {
    let (a, b) = (picture(2, &[GREY; 4]), picture(4, &[GREY; 4]));
    let found = compare(&a, &b, Tolerance { pixels: Some(100), error: 255.0, flip: Some(1.0) });
    assert!(!found.same && found.pixels.is_none() && heat(&a, &b, Tolerance::default()).is_none());
    assert_eq!(found.summary, ["the size is 4 x 1 px, before 2 x 2 px"]);
    assert_eq!(sniff(b"solid"), None);
    let broken = b"\x89PNG\r\n\x1a\n and so on";
    assert!(Picture::read(broken, sniff(broken).unwrap(), &Limits::default()).is_err());
    let small = Limits::default().with(|limits| limits.memory_bytes = 64);
    let mut png = Vec::new();
    image::RgbaImage::new(64, 64).write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
    assert!(Picture::read(&png, ImageFormat::Png, &small).is_err());
}

/// A picture of bands of colour, and the same with a patch of another colour, a line, a disk and a faint band.
fn two() -> [Picture; 2] {
    let (width, height) = (96_u32, 64_u32);
    let plain = |x: u32, y: u32| [2 * x + y, 3 * y + 40, x * y / 16].map(|value| (value % 256) as u8);
    let changed = |x: u32, y: u32| {
        let [r, mut g, mut b] = plain(x, y);
        if (20..40).contains(&x) && (10..30).contains(&y) {
            g = g.saturating_add(60);
        }
        if y >= 56 {
            b = b.wrapping_add(3);
        }
        match x.abs_diff(78).pow(2) + y.abs_diff(40).pow(2) < 100 {
            true => [0, 0, b.wrapping_sub(plain(x, y)[2])],
            false if x == 60 => [255, 255, if y >= 56 { 2 } else { 255 }],
            false => [r, g, b],
        }
    };
    let all = |pixel: &dyn Fn(u32, u32) -> [u8; 3]| -> Picture {
        let at = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let pixels: Vec<[u8; 4]> = at.map(|(x, y)| pixel(x, y)).map(|[r, g, b]| [r, g, b, 255]).collect();
        picture(width, &pixels)
    };
    [all(&plain), all(&changed)]
}

/// Figures of the authors' own program, flip-evaluator 1.7 from PyPI, on the pictures of [`two`]. It computes in f32.
#[test]
fn flip_is_that_of_its_authors() {
    let [a, b] = two();
    let found = flip(&a, &b).unwrap();
    assert!((found.mean - 0.181_664).abs() < 1e-4, "{}", found.mean);
    assert!((found.max - 0.981_652).abs() < 1e-3, "{}", found.max);
    let expected = [
        ([0, 0], 0.0),
        ([30, 20], 0.865_288),
        ([20, 10], 0.592_295),
        ([60, 5], 0.920_624),
        ([62, 5], 0.520_453),
        ([78, 40], 0.972_263),
        ([70, 40], 0.970_515),
        ([95, 63], 0.066_031),
        ([45, 33], 0.012_511),
        ([39, 29], 0.567_529),
    ];
    for ([x, y], error) in expected {
        let own = found.errors[y * 96 + x];
        assert!((own - error).abs() < 2e-3, "({x}, {y}): {own}, and {error} expected");
    }
    assert_eq!((expected.len(), found.errors.len()), (10, 96 * 64));
}

#[test]
fn flip_of_known_pairs_and_of_nothing() {
    let plain = |color: [u8; 4]| picture(32, &[color; 32 * 32]);
    let of = |a, b| flip(&plain(a), &plain(b)).unwrap();
    let (black, white) = ([0, 0, 0, 255], [255; 4]);
    let found = of(black, white);
    assert!((found.mean - 0.967_395).abs() < 1e-4 && (found.max - found.mean).abs() < 1e-9, "{}", found.mean);
    assert!((of([0, 255, 0, 255], [0, 0, 255, 255]).mean - 1.0).abs() < 1e-6);
    assert_eq!(of(white, [7, 7, 7, 0]).max, 0.0, "what is transparent is seen over white");
    let [a, b] = two();
    assert_eq!(flip(&a, &a).unwrap().max, 0.0);
    assert!(flip(&a, &plain(white)).is_none());
    // The same at any number of threads, and in both directions.
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| flip(&a, &b)).unwrap();
    assert_eq!(one, flip(&a, &b).unwrap());
    assert!((flip(&b, &a).unwrap().mean - one.mean).abs() < 1e-12);
    let is_same = |flip, pixels| compare(&a, &b, Tolerance { pixels, error: 0.0, flip }).same;
    assert!(is_same(Some(0.19), None) && !is_same(Some(0.18), None));
    assert!(!is_same(Some(0.19), Some(100)) && !is_same(None, Some(100)) && is_same(None, Some(96 * 64)));
    let heat = flip_heat(&a, &b).unwrap();
    let is_colored = |x: usize, y: usize| heat.rgba[4 * (y * 96 + x)] != heat.rgba[4 * (y * 96 + x) + 2];
    assert!(is_colored(30, 20) && is_colored(95, 63) && !is_colored(0, 0) && !is_colored(45, 33));
}
