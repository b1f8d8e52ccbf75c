//! The last step of a picture whose colours stay in linear light, for both back-ends. It lays the colours of a row
//! over the background and rounds them to half floats. Other pictures become sRGB bytes instead (`resolve`).

use half::f16;

use super::cpu::resolve::{is_composited, over_background};
use crate::plan::DrawPlan;

/// Writes a row of the picture. `colors` is what stage resolve reads: premultiplied, with negative alpha where lines have
/// blended the background in already.
pub fn write_row(plan: &DrawPlan<'_>, row: u32, colors: impl Iterator<Item = [f32; 4]>, out: &mut [[f16; 4]]) {
    let background = plan.background_at(row);
    for (color, out) in colors.zip(out) {
        let [r, g, b, a] = color;
        let color = if is_composited(&color) { [r, g, b, -a] } else { over_background(color, background) };
        *out = color.map(f16::from_f32);
    }
}
