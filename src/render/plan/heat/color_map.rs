//! The two colour maps that turn numbers into colours in diagnostic pictures. `SEQUENTIAL` (viridis) gets
//! lighter evenly from the lowest number to the highest. `DIVERGING` goes from blue through light grey to
//! red, for numbers with a neutral middle.

use std::sync::LazyLock;

use crate::spec::color::Rgba;

/// A colour map as linear colours, from the lowest number to the highest.
pub type ColorMap = LazyLock<[[f32; 4]; 256]>;

/// From dark purple to yellow, lighter all the way: viridis by Smith and van der Walt, released into the
/// public domain (CC0), at ten places of its length.
pub static SEQUENTIAL: ColorMap = LazyLock::new(|| {
    between(&[
        [0x44, 0x01, 0x54],
        [0x48, 0x28, 0x78],
        [0x3e, 0x49, 0x89],
        [0x31, 0x68, 0x8e],
        [0x26, 0x82, 0x8e],
        [0x1f, 0x9e, 0x89],
        [0x35, 0xb7, 0x79],
        [0x6e, 0xce, 0x58],
        [0xb5, 0xde, 0x2b],
        [0xfd, 0xe7, 0x25],
    ])
});

/// From blue by light grey to red: the smooth cool-warm map of Moreland, "Diverging color maps for
/// scientific visualization", 2009.
pub static DIVERGING: ColorMap = LazyLock::new(|| {
    between(&[
        [0x3b, 0x4c, 0xc0],
        [0x68, 0x8a, 0xef],
        [0x99, 0xba, 0xff],
        [0xc9, 0xd7, 0xf0],
        [0xdd, 0xdd, 0xdd],
        [0xed, 0xd1, 0xc2],
        [0xf7, 0xa8, 0x89],
        [0xe2, 0x69, 0x52],
        [0xb4, 0x04, 0x26],
    ])
});

/// The colour of what has no number: magenta, which no map has.
const NONE: [u8; 4] = [0xd0, 0x1c, 0x9b, 0xff];

/// The colour at a share from 0 to 1.
pub fn color(map: &[[f32; 4]; 256], share: f32) -> [f32; 4] {
    if share.is_nan() {
        return Rgba::from_srgb8(NONE).0;
    }
    map[(share.clamp(0.0, 1.0) * 255.0 + 0.5) as usize]
}

/// The colours between some, at equal distances, blended as they are stored.
fn between(stops: &[[u8; 3]]) -> [[f32; 4]; 256] {
    std::array::from_fn(|i| {
        let steps = stops.len() - 1;
        let (at, rest) = (i * steps / 255, i * steps % 255);
        let (low, high) = (stops[at], stops[(at + 1).min(steps)]);
        let blend = |k: usize| {
            let [low, high] = [usize::from(low[k]), usize::from(high[k])];
            ((low * (255 - rest) + high * rest + 127) / 255) as u8
        };
        Rgba::from_srgb8([blend(0), blend(1), blend(2), 255]).0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance([r, g, b, _]: [f32; 4]) -> f32 {
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn the_sequential_map_gets_lighter_all_the_way_and_the_other_to_its_middle() {
        let rises = |map: &[[f32; 4]]| map.windows(2).all(|pair| luminance(pair[1]) >= luminance(pair[0]) - 4e-3);
        assert!(rises(&SEQUENTIAL[..]));
        assert!(rises(&DIVERGING[..128]));
        let mut falls: Vec<_> = DIVERGING[128..].to_vec();
        falls.reverse();
        assert!(rises(&falls));
        assert!(luminance(SEQUENTIAL[255]) > 10.0 * luminance(SEQUENTIAL[0]));
    }

    #[test]
    fn ends_and_numbers_that_are_none_have_their_colours() {
        assert_eq!(color(&SEQUENTIAL, 0.0), Rgba::from_srgb8([0x44, 0x01, 0x54, 255]).0);
        assert_eq!(color(&SEQUENTIAL, 7.0), Rgba::from_srgb8([0xfd, 0xe7, 0x25, 255]).0);
        assert_eq!(color(&DIVERGING, 0.5), Rgba::from_srgb8([0xdd, 0xdd, 0xdd, 255]).0);
        assert_eq!(color(&DIVERGING, f32::NAN), Rgba::from_srgb8(NONE).0);
    }
}
