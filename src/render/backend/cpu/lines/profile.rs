//! The area of a pixel that a long straight line covers, as a function of the distance between the line and the
//! pixel's centre (stage lines). Twin of `strip_area` in `shaders/lines/stroke.wgsl`.

/// Coverage of a pixel's box by a strip, as a function of the distance between their centres.
///
/// The box filter's profile across a line with unit normal n is a box of width `|nx|`, filtered by one of width `|ny|`:
/// a trapezoid of area 1, whose half supports are `(|nx| + |ny|) / 2` at the foot and `||nx| - |ny|| / 2` at the top.
/// Coverage is its integral over the strip's width.
///
/// A ramp is a third box. The two widest of the three make the trapezoid, and Gauss's rule takes the mean over the
/// narrowest: three places, by which coverage is within .002.
pub struct Profile {
    half_width: f32,
    foot: f32,
    top: f32,
    height: f32,
    /// Curvature of the integral on the flanks.
    flank: f32,
    /// Distance of the outer two of the places from the middle one; 0 without a ramp.
    shift: f32,
}

/// Distance of the outer places of Gauss's rule from the middle, as a share of half of the range.
pub const GAUSS_PLACE: f32 = 0.774_596_7;

/// Weights of the outer places and of the middle.
pub const GAUSS_OUTER: f32 = 5.0 / 18.0;
/// See [`GAUSS_OUTER`].
pub const GAUSS_MIDDLE: f32 = 8.0 / 18.0;

impl Profile {
    /// A profile of a line with this unit normal, by half of its width and half of its ramp's, pixels.
    #[inline(always)]
    pub fn new(half_width: f32, half_ramp: f32, normal: [f32; 2]) -> Self {
        let (nx, ny) = (normal[0].abs(), normal[1].abs());
        let (widest, other, ramp) = (nx.max(ny), nx.min(ny), 2.0 * half_ramp);
        let (second, narrowest) = (other.max(ramp), other.min(ramp));
        let (foot, top) = (0.5 * (widest + second), 0.5 * (widest - second).abs());
        let height = 1.0 / (foot + top);
        let flank = if foot > top { 0.5 * height / (foot - top) } else { 0.0 };
        Self { half_width, foot, top, height, flank, shift: narrowest * (0.5 * GAUSS_PLACE) }
    }

    /// The mean of `T(d + w/2) - T(d - w/2)` over the narrowest box, T the trapezoid's integral.
    #[inline(always)]
    pub fn coverage(&self, distance: f32) -> f32 {
        if distance >= self.half_width + self.foot + self.shift {
            return 0.0;
        }
        let middle = self.strip(distance);
        if self.shift == 0.0 {
            return middle.clamp(0.0, 1.0);
        }
        let outer = self.strip(distance - self.shift) + self.strip(distance + self.shift);
        (GAUSS_OUTER * outer + GAUSS_MIDDLE * middle).clamp(0.0, 1.0)
    }

    #[inline(always)]
    fn strip(&self, distance: f32) -> f32 {
        self.half_integral(distance + self.half_width) - self.half_integral(distance - self.half_width)
    }

    /// Integral of the trapezoid from its middle to `u`.
    #[inline(always)]
    fn half_integral(&self, u: f32) -> f32 {
        let a = u.abs().min(self.foot);
        let past = (a - self.top).max(0.0);
        let half = self.height * a - self.flank * past * past;
        if u < 0.0 { -half } else { half }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over a ramp's width, in many places, of what is exact without one.
    fn integrated(half_width: f32, half_ramp: f32, normal: [f32; 2], distance: f32) -> f64 {
        let profile = Profile::new(half_width, 0.0, normal);
        let places = 2000;
        let at = |i: i32| (i as f32 + 0.5) / places as f32 * 2.0 - 1.0;
        let sum: f64 = (0..places).map(|i| f64::from(profile.coverage((distance + at(i) * half_ramp).abs()))).sum();
        sum / f64::from(places)
    }

    #[test]
    fn ramps_are_integrated() {
        let (mut cases, mut farthest, mut partial) = (0, 0.0_f64, 0);
        for (half_width, half_ramp) in
            [0.05, 0.25, 0.5, 1.0, 2.0].into_iter().flat_map(|w| [0.05, 0.125, 0.4, 0.75, 2.5].map(|s| (w, s)))
        {
            for step in 0..=18 {
                let (ny, nx) = (step as f32 * 2.5_f32).to_radians().sin_cos();
                let profile = Profile::new(half_width, half_ramp, [nx, ny]);
                for place in 0..12 {
                    let distance = place as f32 / 11.0 * (half_width + half_ramp + 0.75);
                    let want = integrated(half_width, half_ramp, [nx, ny], distance);
                    farthest = farthest.max((f64::from(profile.coverage(distance)) - want).abs());
                    partial += usize::from(want > 0.0 && want < 1.0);
                    cases += 1;
                }
            }
        }
        assert!(cases == 25 * 19 * 12 && partial > cases / 2, "{partial} of {cases}");
        assert!(farthest < 0.002, "{farthest}");
    }
}
