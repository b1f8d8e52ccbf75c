//! Lines behind faces with a short gap between them: a thin face in the gap hides the lines even if
//! no sample sees it, and an open slit shows them.

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::{DrawPlan, Edge, LinePass, Shown};

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;

const SIZE_PX: [u32; 2] = [120, 96];

/// Samples per pixel, and a width that a face without a sample may have.
const WIDTHS: [(u32, f32); 4] = [(1, 0.8), (4, 0.5), (8, 0.36), (16, 0.3)];

/// Lines behind a wall.
#[derive(Clone, Copy, Debug)]
struct Lines {
    /// True if they end within each strip.
    in_pieces: bool,
    contour: bool,
    keeps_short_parts: bool,
}

const VISIBLE: Lines = Lines { in_pieces: false, contour: false, keeps_short_parts: false };

/// Lines whose short parts may be dropped.
const CASES: [Lines; 3] = [VISIBLE, Lines { in_pieces: true, ..VISIBLE }, Lines { contour: true, ..VISIBLE }];

/// Columns of a wall per row of the picture, in steps of 1/64: then all corners of a strip's faces lie on the line
/// through the first and the last, and there are no cracks beside it.
const SLOPES: [i16; 5] = [-61, -20, 0, 11, 52];

/// Between two parts of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    /// Faces of a quarter of a pixel's height.
    SmallFaces,
    /// The left part, which goes on.
    Wall,
    Nothing,
}

/// Left borders of a wall's parts in the middle row.
fn parts() -> impl Iterator<Item = f32> {
    const PITCH_PX: f32 = 14.3125;
    (-9..=8).map(|k| k as f32 * PITCH_PX)
}

/// Columns that a strip takes in a row.
fn strip_columns(slope: i16, width_px: f32) -> f32 {
    let slope = f32::from(slope) / 64.0;
    (width_px * (1.0 + slope * slope).sqrt() * 256.0).round() / 256.0
}

/// Positions and triangles of a wall that leans, before a face whose lines it hides: in turns a part, a narrow
/// strip, a part, and a wide opening.
fn wall(slope: i16, width_px: f32, strip: Between) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    const ROW_PX: f32 = 0.25;
    const ROWS: u32 = 480;
    let strip_px = strip_columns(slope, width_px);
    let slope = f32::from(slope) / 64.0;
    let mut positions = vec![[-300.0, -200.0, 0.2], [300.0, -200.0, 0.2], [0.0, 400.0, 0.2]];
    let mut triangles = vec![[0, 1, 2]];
    let mut add = |left: f32, right: f32, rows: u32| {
        let first = positions.len() as u32;
        for row in 0..=rows {
            let y = (row as f32 / rows as f32 - 0.5) * ROW_PX * ROWS as f32;
            positions.extend([left, right].map(|x| [x + slope * y, y, 0.6]));
        }
        let square = |row| [first, first + 1, first + 2, first + 3].map(|v| v + 2 * row);
        triangles.extend((0..rows).map(square).flat_map(|[a, b, c, d]| [[a, b, c], [b, d, c]]));
    };
    for at in parts() {
        let parts_px = if strip == Between::Wall { 5.0 + strip_px } else { 5.0 };
        add(at, at + parts_px, 1);
        if strip == Between::SmallFaces {
            add(at + 5.0, at + 5.0 + strip_px, ROWS);
        }
        add(at + 5.0 + strip_px, at + 11.0, 1);
    }
    (positions, triangles)
}

/// A pass of red lines.
fn pass(edges: Vec<Edge>, lines: Lines) -> LinePass {
    let Lines { contour, keeps_short_parts, .. } = lines;
    let color = [1.0, 0.0, 0.0, 1.0];
    LinePass { color, shown: Shown::Visible, contour, keeps_short_parts, ..LinePass::new(Arc::new(edges), 1.5) }
}

fn draw(plan: &DrawPlan<'_>) -> Image {
    CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap()
}

/// On the CPU, and on each GPU with the same result.
fn draw_everywhere(plan: &DrawPlan<'_>, name: &str) -> Image {
    let cpu = draw(plan);
    for gpu in gpus().into_iter().flatten() {
        let gpu = GpuRenderer::new(gpu.clone()).draw(plan, &Deadline::default()).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, name);
    }
    cpu
}

/// Lines behind a wall: of each, the ends of its pieces in order. These are the line's ends and, in pieces, the middles
/// of strips.
fn ends_of_lines(slope: i16, width_px: f32, in_pieces: bool) -> Vec<Vec<[f32; 3]>> {
    let row = |k: i32, x: f32| k as f32 * 7.13 + (x + 70.0) / 140.0;
    let middle = |k: i32, at: f32| {
        let (column, slope) = (at + 5.0 + 0.5 * strip_columns(slope, width_px), f32::from(slope) / 64.0);
        (column + slope * row(k, 0.0)) / (1.0 - slope / 140.0)
    };
    let line = |k: i32| {
        let mut columns: Vec<f32> = parts().filter(|_| in_pieces).map(|at| middle(k, at)).collect();
        columns.retain(|x| x.abs() < 69.0);
        columns.insert(0, -70.0);
        columns.push(70.0);
        columns.iter().map(|&x| [x, row(k, x), 0.2]).collect()
    };
    (-6..=6).map(line).collect()
}

/// The sum of how red the pixels of a wall's picture are.
fn ink(slope: i16, (samples, width_px): (u32, f32), strip: Between, lines: Lines) -> f64 {
    let (mut positions, triangles) = wall(slope, width_px, strip);
    let mut edges = Vec::new();
    for line in ends_of_lines(slope, width_px, lines.in_pieces) {
        let first = positions.len() as u32;
        let edge = |k: u32| Edge { vertices: [first + k, first + k + 1], faces: [0, Edge::NO_FACE] };
        edges.extend((0..line.len() as u32 - 1).map(edge));
        positions.extend(line);
    }
    let mut plan = scenes::screen_plan(SIZE_PX, samples, 1.0, &positions, &triangles);
    plan.lines = vec![pass(edges, lines)];
    let name = format!("slope {slope}, {samples} samples, {strip:?}, {lines:?}");
    // A wall without gaps is only what others are measured against.
    red(&if strip == Between::Wall { draw(&plan) } else { draw_everywhere(&plan, &name) })
}

/// The sum of how red the pixels of a picture on white are.
fn red(image: &Image) -> f64 {
    image.rgba.chunks(4).map(|p| (255.0 - f64::from(p[2])) / 255.0).sum()
}

#[test]
fn a_face_without_a_sample_hides_lines() {
    let mut cases = 0;
    for slope in SLOPES {
        for case in WIDTHS {
            for lines in CASES {
                let [ink_px2, want] = [Between::SmallFaces, Between::Wall].map(|strip| ink(slope, case, strip, lines));
                // A gap across a steep strip is longer than the 1 px that is looked at.
                let is_longer = case.0 == 1 && slope.abs() > 48;
                let share = if is_longer { 0.4 } else { 0.02 };
                assert!((ink_px2 - want).abs() < share * want, "{slope} {case:?} {lines:?}: {ink_px2} of {want}");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, CASES.len() * SLOPES.len() * WIDTHS.len());
}

#[test]
fn a_slit_shows_lines() {
    let mut cases = 0;
    for slope in SLOPES {
        for (samples, width_px) in WIDTHS {
            for lines in CASES {
                let of_slits = |samples| {
                    let [slits, wall] =
                        [Between::Nothing, Between::Wall].map(|strip| ink(slope, (samples, width_px), strip, lines));
                    slits - wall
                };
                let (ink_px2, want) = (of_slits(samples), of_slits(16));
                let least = if samples == 1 { 0.7 } else { 0.88 };
                let name = format!("{slope}, {samples} samples, {lines:?}");
                assert!(want > 100.0 && ink_px2 > least * want, "{name}: {ink_px2} of {want}");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, CASES.len() * SLOPES.len() * WIDTHS.len());
}

/// Ink of lines behind parts of a wall, beyond which nothing is. Each ends within a strip of small faces at the
/// wall's border, and each elsewhere in its pixel.
fn ends_behind_a_border((samples, width_px): (u32, f32), lines: Lines) -> f64 {
    const ENDS: u32 = 16;
    const ROWS: u32 = 16;
    let (mut positions, mut triangles, mut edges) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..ENDS * ENDS {
        let [column, row] = [k % ENDS, k / ENDS].map(|v| v as f32);
        let [x, y] = [(column - 7.5) * 7.0 + column / 16.0, (row - 7.5) * 5.5 + row / 16.0];
        let mut add = |left: f32, right: f32, rows: u32| {
            let first = positions.len() as u32;
            let at = |row: u32| y + (row as f32 / rows as f32 - 0.5) * 4.0;
            positions.extend((0..=rows).flat_map(|row| [[left, at(row), 0.6], [right, at(row), 0.6]]));
            let square = |row| [first, first + 1, first + 2, first + 3].map(|v| v + 2 * row);
            triangles.extend((0..rows).map(square).flat_map(|[a, b, c, d]| [[a, b, c], [b, d, c]]));
        };
        add(x - 3.0, x, 1);
        add(x, x + width_px, ROWS);
        let first = positions.len() as u32;
        positions.extend([[x - 2.0, y, 0.2], [x + width_px, y, 0.2]]);
        edges.push(Edge { vertices: [first, first + 1], faces: [Edge::NO_FACE; 2] });
    }
    let mut plan = scenes::screen_plan(SIZE_PX, samples, 1.0, &positions, &triangles);
    let without = red(&draw(&plan));
    plan.lines = vec![pass(edges, lines)];
    red(&draw_everywhere(&plan, &format!("{samples} samples, {lines:?}"))) - without
}

#[test]
fn contours_leave_fewer_dots_where_samples_see_beyond_a_border() {
    for case in WIDTHS {
        let [ink_px2, of_contours] =
            [false, true].map(|contour| ends_behind_a_border(case, Lines { contour, ..VISIBLE }));
        assert!(ink_px2 > 15.0, "{case:?}: {ink_px2}");
        // A quarter of one sample is none.
        let share = if case.0 == 1 { 1.0..=1.0 } else { 0.5..=0.8 };
        assert!(share.contains(&(of_contours / ink_px2)), "{case:?}: {of_contours} of {ink_px2}");
    }
}

#[test]
fn kept_short_parts_show_through_faces_without_a_sample() {
    // Each width with another slope: that all slopes hide lines is tested above.
    for (case, slope) in WIDTHS.into_iter().zip(SLOPES) {
        let [dropped, kept] = [false, true].map(|keeps_short_parts| {
            let lines = Lines { keeps_short_parts, ..VISIBLE };
            [ink(slope, case, Between::SmallFaces, lines), ends_behind_a_border(case, lines)]
        });
        // Lines show through strips whose faces no sample sees, and at ends that such faces hide beside a wall.
        let [into_gaps, at_borders] = [0, 1].map(|k| kept[k] / dropped[k]);
        assert!(into_gaps > 1.03 && at_borders > 1.2, "{case:?}: {kept:?} and {dropped:?}");
    }
}
