//! Stage lines, per strip and pixel: the covered area. Twin of `strip_area` in
//! `shaders/lines/stroke.wgsl`.

/// Coverage of a pixel's box by a strip, as a function of the distance between their centres.
///
/// The box filter's profile across a line with unit normal n is a trapezoid of area 1; its half
/// supports are `(|nx| + |ny|) / 2` at the foot and `||nx| - |ny|| / 2` at the top. Coverage is its
/// integral over the strip's width.
pub struct Profile {
    half_width: f32,
    foot: f32,
    top: f32,
    height: f32,
    /// Curvature of the integral on the flanks.
    flank: f32,
}

impl Profile {
    /// A profile of a line with this unit normal, half as wide as `half_width` with a ramp half as
    /// wide as `half_ramp`, pixels.
    #[inline(always)]
    pub fn new(half_width: f32, half_ramp: f32, normal: [f32; 2]) -> Self {
        let (nx, ny) = (normal[0].abs(), normal[1].abs());
        let (foot, top) = (0.5 * (nx + ny) + half_ramp, (0.5 * (nx - ny).abs() - half_ramp).abs());
        let height = 1.0 / (foot + top);
        let flank = if foot > top { 0.5 * height / (foot - top) } else { 0.0 };
        Self { half_width, foot, top, height, flank }
    }

    /// `T(d + w/2) - T(d - w/2)`, T the trapezoid's integral.
    #[inline(always)]
    pub fn coverage(&self, distance: f32) -> f32 {
        if distance >= self.half_width + self.foot {
            return 0.0;
        }
        let strip = self.half_integral(distance + self.half_width) - self.half_integral(distance - self.half_width);
        strip.clamp(0.0, 1.0)
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
