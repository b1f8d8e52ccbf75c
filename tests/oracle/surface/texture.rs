//! A grey texture, and what a pixel sees of it: the mean over the part that it covers.

use super::super::vector::V2;

/// Linear values of a square of `side` texels, row by row.
pub struct Grey {
    side: usize,
    values: Vec<f64>,
    wrap: Wrap,
}

/// The texels beyond the borders of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The texture once more.
    Repeat,
    /// Its mirror image.
    Mirror,
    /// The nearest one of the border.
    Clamp,
}

impl Wrap {
    /// The texel at a place, of `side` ones.
    fn texel(self, i: i64, side: i64) -> usize {
        let at = match self {
            Self::Repeat => i.rem_euclid(side),
            Self::Mirror => i.rem_euclid(2 * side).min(2 * side - 1 - i.rem_euclid(2 * side)),
            Self::Clamp => i.clamp(0, side - 1),
        };
        at as usize
    }
}

impl Grey {
    /// A texture that repeats, from stored bytes of a colour.
    pub fn new(side: usize, bytes: &[u8]) -> Self {
        let values = bytes.iter().map(|&byte| super::srgb::to_linear(f64::from(byte) / 255.0)).collect();
        Self { side, values, wrap: Wrap::Repeat }
    }

    /// The same from stored bytes of something else, as of opacity or a normal's axis: 0 to 1.
    pub fn linear(side: usize, bytes: &[u8]) -> Self {
        let values = bytes.iter().map(|&byte| f64::from(byte) / 255.0).collect();
        Self { side, values, wrap: Wrap::Repeat }
    }

    /// This texture with other texels beyond its borders.
    pub fn wrapped(self, wrap: Wrap) -> Self {
        Self { wrap, ..self }
    }

    /// Half the size: each texel the mean of four.
    pub fn halved(&self) -> Self {
        let side = self.side / 2;
        let value = |x: usize, y: usize| self.values[y * self.side + x];
        let mean = |x: usize, y: usize| {
            (value(2 * x, 2 * y) + value(2 * x + 1, 2 * y) + value(2 * x, 2 * y + 1) + value(2 * x + 1, 2 * y + 1))
                / 4.0
        };
        Self { side, values: (0..side * side).map(|i| mean(i % side, i / side)).collect(), wrap: self.wrap }
    }

    /// The value at a place, between the four nearest texels. The whole texture is 1 wide and high.
    pub fn at(&self, [u, v]: [f64; 2]) -> f64 {
        let side = self.side as i64;
        let [s, t] = [u, v].map(|w| w * side as f64 - 0.5);
        let (x, y) = (s.floor(), t.floor());
        let value = |dx: i64, dy: i64| {
            let [x, y] = [x as i64 + dx, y as i64 + dy].map(|i| self.wrap.texel(i, side));
            self.values[y * self.side + x]
        };
        let across = |dy: i64| value(0, dy) * (1.0 - (s - x)) + value(1, dy) * (s - x);
        across(0) * (1.0 - (t - y)) + across(1) * (t - y)
    }

    /// The mean over a pixel, of `points` squared places. `place` says what of the texture lies at a point of the
    /// picture; None if some point shows none.
    pub fn over_pixel(&self, pixel: [u32; 2], points: u32, place: impl Fn(V2) -> Option<V2>) -> Option<f64> {
        over_pixel(pixel, points, |point| Some(self.at(place(point)?)))
    }
}

/// The mean over a pixel of values at `points` squared places; None if some point has none.
pub fn over_pixel([x, y]: [u32; 2], points: u32, value: impl Fn(V2) -> Option<f64>) -> Option<f64> {
    let mut sum = 0.0;
    for i in 0..points * points {
        let [dx, dy] = [i % points, i / points].map(|k| (f64::from(k) + 0.5) / f64::from(points));
        sum += value([f64::from(x) + dx, f64::from(y) + dy])?;
    }
    Some(sum / f64::from(points * points))
}

/// What trilinear filtering makes of a place, in a pixel whose steps to the right and down are so long in the texture.
pub fn trilinear(levels: &[Grey], place: [f64; 2], steps: [[f64; 2]; 2]) -> f64 {
    let length = |step: [f64; 2]| step[0].hypot(step[1]) * levels[0].side as f64;
    let lod = length(steps[0]).max(length(steps[1])).log2().clamp(0.0, (levels.len() - 1) as f64);
    let (fine, share) = (lod.floor() as usize, lod.fract());
    let coarse = (fine + 1).min(levels.len() - 1);
    levels[fine].at(place) * (1.0 - share) + levels[coarse].at(place) * share
}
