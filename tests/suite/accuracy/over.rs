//! The accuracy of colours where lines lie over a surface and its border, against the oracle's
//! points, in 1/255. Only pixels that a line covers in part count.

use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::spec::Spec;

use crate::oracle::lines::coverage::ink;
use crate::oracle::screen::Screen;
use crate::oracle::surface::rays::{Pen, picture};
use crate::oracle::surface::srgb;
use crate::oracle::vector::V3;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::truth::{Errors, Gate, cases, points_per_side, renderers, scene, segments};
use crate::support::{scenes, shapes};

const SIZE_PX: [u32; 2] = [160, 130];
/// Lines' widths and numbers of samples: few, or all in the long run.
fn widths_and_samples() -> (&'static [f64], &'static [u32]) {
    cases((&[0.5, 2.5], &[1, 4]), (&[0.5, 1.0, 2.5], &[1, 4, 8, 16]))
}

/// Lines drawn over a surface of one colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lines {
    /// Along its border.
    Contour,
    /// Along all of its edges.
    Wires,
}

fn spec(lines: Lines, width_px: f64, samples: u32, opacity: f64) -> Spec {
    let (width, samples) = (width_px.to_string(), samples.to_string());
    let size = format!("{}x{}", SIZE_PX[0], SIZE_PX[1]);
    let mut keys = vec![("size", size.as_str()), ("samples", &samples), ("background", "2040a0")];
    // Not along the planes of a cube's diagonals, where it is open what hides what.
    keys.extend([("camera.eye", "5.3,4.1,6.1"), ("camera.target", "0,0,0")]);
    let shown = match lines {
        Lines::Contour => [
            ("outline.method", "contour"),
            ("outline.unit", "px"),
            ("outline.color", "100"),
            ("outline.thickness", &width),
        ],
        Lines::Wires => {
            [("wire.hidden", "hide"), ("wire.edges", "polygons"), ("wire.color", "100"), ("wire.thickness", &width)]
        }
    };
    keys.push(("style", if lines == Lines::Wires { "wire" } else { "outline" }));
    keys.extend(shown);
    let mut spec = scenes::spec(&keys);
    // One colour, whose every step is told apart from the background's.
    let opacity = opacity.to_string();
    let surface = [("style", "unlit"), ("surface.color", "f0c060"), ("surface.opacity", opacity.as_str())];
    spec.layers.surface = scenes::spec(&surface).layers.surface;
    spec
}

/// Colours of the pixels that lines cover in part, as they should be: where they are, and red,
/// green and blue. A surface of this opacity lies nowhere over itself.
fn truth(plan: &DrawPlan<'_>, opacity: f64) -> Vec<(usize, V3)> {
    let [pass] = &plan.lines[..] else { panic!("{} passes", plan.lines.len()) };
    let look = plan.surface.as_ref().unwrap().materials[0];
    let [line, surface, background] =
        [pass.color, look.base_color, plan.background].map(|c| [0, 1, 2].map(|k| f64::from(c[k])));
    let surface = [0, 1, 2].map(|k| opacity * surface[k] + (1.0 - opacity) * background[k]);
    let (segments, width) = (segments(plan), f64::from(pass.width_px));
    let pen = Pen { segments: &segments, width, color: line };
    let side = points_per_side();
    let colors = picture(&Screen::new(&scene(plan)), &pen, background, side, |_, _| surface);
    let covered = ink(SIZE_PX, &segments, width, side);
    let in_part = |&(i, _): &(usize, V3)| covered[i] > 0.0 && covered[i] < 1.0;
    colors.into_iter().map(|c| c.map(srgb::from_linear)).enumerate().filter(in_part).collect()
}

fn errors(image: &Image, truth: &[(usize, V3)]) -> Errors {
    let drawn = truth.iter().flat_map(|(i, _)| image.rgba[4 * i..4 * i + 3].iter().map(|&v| f64::from(v) / 255.0));
    Errors::of(&drawn.collect::<Vec<_>>(), &truth.iter().flat_map(|(_, color)| *color).collect::<Vec<_>>())
}

/// The gate. A line as wide as samples are apart leaves no doubt on which side of it a point is.
fn now(width_px: f64, samples: u32) -> Gate {
    let rmse = match samples {
        1 if width_px < 1.0 => 21.0,
        1 if width_px < 2.0 => 4.0,
        1 => 1.6,
        4 if width_px < 1.0 => 2.8,
        8 if width_px < 1.0 => 1.4,
        _ => 1.2,
    };
    Gate { rmse, max: f64::INFINITY, ink: f64::INFINITY }
}

/// A mesh in every number of samples, with every kind of lines. Glass is drawn in layers.
fn measure(name: &str, obj: &str, opacity: f64) {
    let (mut missed, mut drawn) = (Vec::new(), 0);
    let mut renderers = renderers();
    let mesh = scenes::mesh(obj);
    let (widths_px, samples) = widths_and_samples();
    let all_lines = [Lines::Contour, Lines::Wires].into_iter();
    for (lines, width_px) in all_lines.flat_map(|l| widths_px.iter().map(move |&w| (l, w))) {
        let truth = truth(&scenes::plan(&mesh, &spec(lines, width_px, 1, 1.0)), opacity);
        assert!(truth.len() > 300, "{name}: {} pixels", truth.len());
        for &samples in samples {
            let spec = spec(lines, width_px, samples, opacity);
            let plan = scenes::plan(&mesh, &spec);
            assert_eq!(plan.peeling().is_some(), opacity < 1.0);
            let mut pictures = Vec::new();
            for renderer in &mut renderers {
                let image = renderer.draw(&plan, &Deadline::default()).unwrap();
                let back_end = renderer.kind().name();
                let what = format!("- over, {name}, {lines:?}, {width_px} px, {samples} samples, {back_end}");
                missed.extend(errors(&image, &truth).check(&what, now(width_px, samples)).err());
                pictures.push(image);
                drawn += 1;
            }
            if let [cpu, gpu] = &pictures[..] {
                Likeness::of(cpu, gpu).assert(Tolerance::TWINS, &format!("{name} {lines:?} {width_px} {samples}"));
            }
        }
    }
    assert_eq!(drawn, 2 * widths_px.len() * samples.len() * renderers.len());
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

#[test]
fn lines_over_a_border_show_what_is_beside_them() {
    measure("cube", &shapes::cube(), 1.0);
    measure("torus", &shapes::torus(24), 1.0);
}

#[test]
fn lines_over_the_border_of_glass_do_too() {
    measure("glass", "v -2 -1.1 0.3\nv 1.9 -0.7 -0.4\nv 1.2 1.7 0.2\nv -1.4 1.1 0.9\nf 1 2 3\nf 1 3 4\n", 0.5);
}
