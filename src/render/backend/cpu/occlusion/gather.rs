//! The light that the surfaces around a pixel block (stage occlusion, screen-space ambient
//! occlusion). This is computed for the pixels of every second column and row; `spread` fills in
//! the others. A pixel looks at 16 places around it. They are one of four sets, and neighbours look
//! at different sets. How much the surface at a place blocks follows from its position in space.
//! Twin of `shaders/occlusion/gather.wgsl`.

use super::grid::{Grid, NOWHERE, PHASES, lanes};
use crate::backend::cpu::geometry::transform::{quick_rsqrt, round_to_i32};
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::{OcclusionPass, TAPS_PER_PIXEL, sample_offsets};

/// Sine of the angle above the surface below which nothing takes light: flat places stay as they are,
/// however they are rounded.
pub const BIAS: f32 = 0.1;

/// Square of the sine up to which a place surely takes nothing, with a margin for rounding.
const TAKES_NOTHING: f32 = BIAS * BIAS * 0.99;

/// Factor of the mean that the places take: two walls that meet at right angles take all of the light from where they do.
pub const GAIN: f32 = 6.0;

/// Values of eight pixels.
type Lanes = [f32; LANES];

dispatch! {
    /// Fills rows of the grid's layout, from row `first` of the picture on: every second pixel of even rows.
    pub fn gather_rows(pass: &OcclusionPass, grid: &Grid, samples: u32, first: u32, out: &mut [f32]) = gather_kernel
}

#[inline(always)]
fn gather_kernel(pass: &OcclusionPass, grid: &Grid, samples: u32, first: u32, out: &mut [f32]) {
    let [x0, y0] = sample_offsets(samples)[0];
    let from = [
        x0 as f32 * (1.0 / 256.0) - 0.5 * grid.width_px as f32,
        y0 as f32 * (1.0 / 256.0) - 0.5 * grid.height_px as f32,
    ];
    for (y, row) in (first..).zip(out.chunks_exact_mut(grid.stride())).filter(|(y, _)| y % 2 == 0) {
        let row_start = grid.index([0, y], [0, 0]) / grid.stride() * grid.stride();
        for phase in [0, 2] {
            for x in (phase..grid.width_px).step_by(PHASES * LANES) {
                let at = grid.index([x, y], [0, 0]);
                let looker = Looker::new(pass, grid, [x, y], from);
                let found = if looker.is_nothing() { [0.0; LANES] } else { looker.look() };
                if let Some(out) = row.get_mut(at - row_start..).and_then(|out| out.first_chunk_mut::<LANES>()) {
                    *out = found;
                }
            }
        }
    }
}

/// Eight pixels that look at the same places, [`PHASES`] columns apart.
struct Looker<'a> {
    pass: &'a OcclusionPass,
    grid: &'a Grid,
    pixel: [u32; 2],
    /// Columns and rows from the picture's middle.
    column: Lanes,
    row: f32,
    /// Places of the pixels' surfaces.
    place: [Lanes; 3],
}

impl<'a> Looker<'a> {
    #[inline(always)]
    fn new(pass: &'a OcclusionPass, grid: &'a Grid, pixel: [u32; 2], from: [f32; 2]) -> Self {
        let mut column = [0.0; LANES];
        for l in 0..LANES {
            column[l] = (pixel[0] + (PHASES * l) as u32) as f32 + from[0];
        }
        let mut looker = Self { pass, grid, pixel, column, row: pixel[1] as f32 + from[1], place: [[0.0; LANES]; 3] };
        looker.place = looker.places([0, 0], looker.depths([0, 0]));
        looker
    }

    #[inline(always)]
    fn is_nothing(&self) -> bool {
        self.place[2].iter().fold(true, |all, depth| all & (*depth == NOWHERE))
    }

    #[inline(always)]
    fn depths(&self, tap: [i32; 2]) -> &Lanes {
        lanes(self.grid.depths(), self.grid.index(self.pixel, tap))
    }

    /// Places of surfaces `tap` away, at these depths.
    #[inline(always)]
    fn places(&self, tap: [i32; 2], depths: &Lanes) -> [Lanes; 3] {
        let [wide, narrower] = self.pass.spread;
        let down = self.row + tap[1] as f32;
        let mut places = [[0.0; LANES], [0.0; LANES], *depths];
        for l in 0..LANES {
            let pixel = wide - narrower * depths[l];
            places[0][l] = (self.column[l] + tap[0] as f32) * pixel;
            places[1][l] = down * pixel;
        }
        places
    }

    /// A tangent along an axis: to the neighbour on that side on which depths lie on a straight line. Zero
    /// between two that show nothing: then nothing takes light.
    #[inline(always)]
    fn tangent(&self, axis: usize) -> [Lanes; 3] {
        let tap = |steps: i32| if axis == 0 { [steps, 0] } else { [0, steps] };
        let [before2, before, after, after2] = [-2, -1, 1, 2].map(|steps| self.depths(tap(steps)));
        let own = self.place[2];
        let (at_before, at_after) = (self.places(tap(-1), before), self.places(tap(1), after));
        let mut tangent = [[0.0; LANES]; 3];
        for l in 0..LANES {
            let bend_before = (before2[l] - 2.0 * before[l]) + own[l];
            let bend_after = (after2[l] - 2.0 * after[l]) + own[l];
            let is_before = bend_before.abs() < bend_after.abs();
            let depth = if is_before { before[l] } else { after[l] };
            for k in 0..3 {
                let step =
                    if is_before { self.place[k][l] - at_before[k][l] } else { at_after[k][l] - self.place[k][l] };
                tangent[k][l] = if depth == NOWHERE { 0.0 } else { step };
            }
        }
        tangent
    }

    /// Unit normals, towards the viewer; zero where a tangent is.
    #[inline(always)]
    fn normals(&self) -> [Lanes; 3] {
        let (a, b) = (self.tangent(0), self.tangent(1));
        let mut normals = [[0.0; LANES]; 3];
        for l in 0..LANES {
            let n = [
                a[1][l] * b[2][l] - a[2][l] * b[1][l],
                a[2][l] * b[0][l] - a[0][l] * b[2][l],
                a[0][l] * b[1][l] - a[1][l] * b[0][l],
            ];
            let inverse = quick_rsqrt(((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]).max(1e-12));
            for k in 0..3 {
                normals[k][l] = n[k] * inverse;
            }
        }
        normals
    }

    /// The light that the places around the pixels take, 1/255.
    #[inline(always)]
    fn look(&self) -> Lanes {
        let normals = self.normals();
        let inverse_square = self.pass.inverse_square();
        let mut taken = [0.0; LANES];
        for &tap in self.pass.taps_of(self.pixel[0], self.pixel[1]) {
            let places = self.places(tap, self.depths(tap));
            let (mut squares, mut alongs, mut takes) = ([0.0; LANES], [0.0; LANES], false);
            for l in 0..LANES {
                let v: [f32; 3] = std::array::from_fn(|k| places[k][l] - self.place[k][l]);
                squares[l] = (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2];
                alongs[l] = (v[0] * normals[0][l] + v[1] * normals[1][l]) + v[2] * normals[2][l];
                let above = alongs[l].max(0.0);
                takes |= above * above > TAKES_NOTHING * squares[l];
            }
            // Most places around most pixels.
            if !takes {
                continue;
            }
            for l in 0..LANES {
                let sine = alongs[l] * quick_rsqrt(squares[l].max(1e-6));
                let near = (1.0 - squares[l] * inverse_square).max(0.0);
                taken[l] += (sine - BIAS).max(0.0) * (near * near);
            }
        }
        let mut found = [0.0; LANES];
        for l in 0..LANES {
            let share = (taken[l] * (GAIN / TAPS_PER_PIXEL as f32)).min(1.0);
            let is_nothing = self.place[2][l] == NOWHERE;
            found[l] = if is_nothing { 0.0 } else { round_to_i32(share * 255.0) as f32 };
        }
        found
    }
}
