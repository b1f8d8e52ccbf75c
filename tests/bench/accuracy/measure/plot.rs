//! The work-precision plot as SVG: time across, error up, both logarithmic; down and to the left is
//! better.

use std::fmt::Write;

use super::summary::{Point, Series, series};
use super::table::Machine;
use super::techniques::{Family, Technique};
use super::{BASELINE, Row};
use meshsnap_render::spec::Samples;

const SIZE: [f64; 2] = [720.0, 430.0];
/// Top and bottom of the plots; the legend is below.
const HEIGHT: [f64; 2] = [44.0, 316.0];

/// A plot of some families, with its own range of times and its own legend.
pub struct Panel {
    title: &'static str,
    families: &'static [Family],
    /// Those of the families' techniques that it shows.
    shows: fn(Technique) -> bool,
}

/// Left and right of the panels.
const PLACES: [[f64; 2]; 2] = [[58.0, 372.0], [410.0, 704.0]];

/// Techniques by themselves.
pub const TECHNIQUES: [Panel; 2] = [
    Panel { title: "wires", families: &[Family::Wires], shows: |_| true },
    Panel {
        title: "outlines, flat faces, textures",
        families: &[Family::Outlines, Family::Faces, Family::Textures],
        shows: |_| true,
    },
];

/// Pictures as users ask for them.
pub const WHOLE: [Panel; 2] = [
    Panel {
        title: "faces",
        families: &[Family::Whole, Family::WholeTextures],
        shows: |t| !matches!(t, Technique::WiredFaces | Technique::OutlinedFaces),
    },
    Panel {
        title: "lines over faces",
        families: &[Family::Whole],
        shows: |t| matches!(t, Technique::WiredFaces | Technique::OutlinedFaces),
    },
];

/// Both panels share the range of errors. Colours are told apart on white and on black.
pub fn svg(rows: &[Row], machine: &Machine, panels: &[Panel; 2]) -> String {
    let of = |panel: &Panel| -> Vec<Series> {
        let all = panel.families.iter().flat_map(|&family| series(rows, family));
        all.filter(|series| (panel.shows)(series.technique)).collect()
    };
    let all: Vec<Vec<Series>> = panels.iter().map(of).collect();
    let points = || all.iter().flatten().flat_map(|s| &s.points);
    let errors = Axis::new(points().map(|p| p.error), [HEIGHT[1], HEIGHT[0]]);
    let mut text = head(&machine.line());
    for ((panel, x), series) in panels.iter().zip(PLACES).zip(&all) {
        let times = Axis::new(series.iter().flat_map(|s| &s.points).map(|p| p.time), x);
        frame(&mut text, panel.title, &times, &errors);
        series.iter().for_each(|s| line(&mut text, s, &times, &errors));
        legend(&mut text, x, series);
    }
    back_ends(&mut text, rows, machine);
    let samples: Vec<String> = panels[0].families[0].samples().iter().map(|&s| s.to_string()).collect();
    markers(&mut text, &samples);
    text.push_str("</svg>\n");
    text
}

/// A logarithmic axis on screen.
struct Axis {
    /// Logarithms to the base 10 of its ends.
    range: [f64; 2],
    ends: [f64; 2],
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, ends: [f64; 2]) -> Self {
        let logs: Vec<f64> = values.filter(|v| *v > 0.0).map(f64::log10).collect();
        let low = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        // Room for markers, and a decade at least, so that there are numbers to read.
        let room = (0.08 * (high - low)).max(0.5 * (1.0 - (high - low))).max(0.06);
        Self { range: [low - room, high + room], ends }
    }

    fn at(&self, v: f64) -> f64 {
        let t = (v.log10() - self.range[0]) / (self.range[1] - self.range[0]);
        self.ends[0] + t * (self.ends[1] - self.ends[0])
    }

    /// 1, 2 and 5 times powers of ten.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.range[0].floor() as i32..=self.range[1].ceil() as i32;
        let all = decades.flat_map(|d| [1.0, 2.0, 5.0].map(|m| m * 10.0_f64.powi(d)));
        all.filter(|v| (self.range[0]..=self.range[1]).contains(&v.log10())).collect()
    }
}

fn head(machine: &str) -> String {
    let mut text = String::new();
    let [w, h] = SIZE;
    let _ = writeln!(
        text,
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" width="{w}" height="{h}" role="img" font-family="system-ui, sans-serif" font-size="11">"#
    );
    let _ = writeln!(text, "<title>Run time against error</title>");
    let _ = writeln!(text, "<desc>{}</desc>", escaped(machine));
    // Readers that know no media queries get the light one.
    text.push_str(
        "<style>.page{fill:#ffffff;stroke:#d0d7de}.text{fill:#24292f}.grid{stroke:#d8dee4}\
         @media (prefers-color-scheme:dark){.page{fill:#0d1117;stroke:#30363d}.text{fill:#e6edf3}.grid{stroke:#30363d}}</style>\n",
    );
    let _ = writeln!(text, r#"<rect class="page" x="0.5" y="0.5" width="{}" height="{}" rx="6"/>"#, w - 1.0, h - 1.0);
    let title = format!("time as a ratio to {BASELINE}; lower left is better");
    label(&mut text, [0.5 * SIZE[0], HEIGHT[1] + 32.0], "middle", &title);
    let _ = writeln!(
        text,
        r#"<text class="text" text-anchor="middle" transform="translate(16 {}) rotate(-90)">RMSE, /255</text>"#,
        0.5 * (HEIGHT[0] + HEIGHT[1])
    );
    text
}

fn label(text: &mut String, [x, y]: [f64; 2], anchor: &str, words: &str) {
    let words = escaped(words);
    let _ = writeln!(text, r#"<text class="text" x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{words}</text>"#);
}

fn frame(text: &mut String, title: &str, times: &Axis, errors: &Axis) {
    let [left, right] = times.ends;
    let [top, bottom] = HEIGHT;
    let mut rule = |x1: f64, y1: f64, x2: f64, y2: f64| {
        let _ = writeln!(text, r#"<path class="grid" d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" fill="none"/>"#);
    };
    times.ticks().into_iter().for_each(|v| rule(times.at(v), top, times.at(v), bottom));
    errors.ticks().into_iter().for_each(|v| rule(left, errors.at(v), right, errors.at(v)));
    for v in times.ticks() {
        label(text, [times.at(v), bottom + 15.0], "middle", &number(v));
    }
    if left == PLACES[0][0] {
        for v in errors.ticks() {
            label(text, [left - 5.0, errors.at(v) + 4.0], "end", &number(v));
        }
    }
    let title = escaped(title);
    let _ = writeln!(
        text,
        r#"<text class="text" x="{left}" y="{}" font-weight="600" font-size="13">{title}</text>"#,
        top - 14.0
    );
}

fn line(text: &mut String, series: &Series, times: &Axis, errors: &Axis) {
    let color = color(series.technique);
    let place = |p: &Point| [times.at(p.time), errors.at(p.error)];
    let (adaptive, fixed): (Vec<&Point>, Vec<&Point>) =
        series.points.iter().partition(|p| p.samples == Samples::Adaptive);
    let places: Vec<[f64; 2]> = fixed.into_iter().map(place).collect();
    let path: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1} {y:.1}")).collect();
    let _ = writeln!(
        text,
        r#"<path d="M{}" fill="none" stroke="{color}" stroke-width="1.5"{}/>"#,
        path.join("L"),
        dashes(series.back_end)
    );
    // More samples, larger markers.
    for (i, place) in places.into_iter().enumerate() {
        marker(text, series.back_end, color, place, 3.0 + 1.5 * i as f64);
    }
    for place in adaptive.into_iter().map(place) {
        ring(text, color, place);
        marker(text, series.back_end, color, place, 3.0);
    }
}

/// What marks adaptive samples.
fn ring(text: &mut String, color: &str, [x, y]: [f64; 2]) {
    let _ =
        writeln!(text, r#"<circle cx="{x:.1}" cy="{y:.1}" r="8" fill="none" stroke="{color}" stroke-width="1.8"/>"#);
}

fn marker(text: &mut String, back_end: &str, color: &str, [x, y]: [f64; 2], r: f64) {
    let _ = match back_end {
        "cpu-1" => writeln!(text, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{r}" fill="{color}"/>"#),
        "cpu-2" => writeln!(
            text,
            r#"<rect x="{:.1}" y="{:.1}" width="{2:.1}" height="{2:.1}" fill="{color}"/>"#,
            x - 0.9 * r,
            y - 0.9 * r,
            1.8 * r
        ),
        _ => writeln!(
            text,
            r#"<path d="M{x:.1} {:.1}L{:.1} {3:.1}L{:.1} {3:.1}z" fill="{color}"/>"#,
            y - 1.2 * r,
            x + 1.1 * r,
            x - 1.1 * r,
            y + 0.8 * r
        ),
    };
}

/// The techniques of a panel by colour.
fn legend(text: &mut String, [left, right]: [f64; 2], series: &[Series]) {
    let mut techniques: Vec<Technique> = series.iter().map(|s| s.technique).collect();
    techniques.dedup();
    let mut x = left;
    let mut y = HEIGHT[1] + 58.0;
    for technique in techniques {
        let words = words(technique);
        let width = 26.0 + 6.3 * words.len() as f64;
        if x + width > right + 12.0 {
            (x, y) = (left, y + 18.0);
        }
        let _ = writeln!(
            text,
            r#"<rect x="{x:.1}" y="{:.1}" width="11" height="11" rx="2" fill="{}"/>"#,
            y - 10.0,
            color(technique)
        );
        label(text, [x + 16.0, y], "start", words);
        x += width;
    }
}

/// The back-ends by marker, and what the size of markers says.
fn back_ends(text: &mut String, rows: &[Row], machine: &Machine) {
    let y = HEIGHT[1] + 100.0;
    let mut x = PLACES[0][0];
    let gpu = if machine.has_software_gpu() { "Vulkan on the CPU" } else { "GPU" };
    let known = [("cpu-1", "CPU, 1 thread"), ("cpu-2", "CPU, 2 threads"), ("gpu", gpu)];
    for (name, words) in known.into_iter().filter(|(name, _)| rows.iter().any(|row| row.back_end == *name)) {
        marker(text, name, "#7d8590", [x + 4.0, y - 4.0], 4.0);
        label(text, [x + 14.0, y], "start", words);
        x += 32.0 + 6.3 * words.len() as f64;
    }
}

/// The samples by size of marker, and the ring of adaptive ones, which are the last.
fn markers(text: &mut String, samples: &[String]) {
    let Some((_, fixed)) = samples.split_last() else { return };
    let words = format!("larger markers: {} samples per pixel; ring: adaptive", fixed.join(", "));
    label(text, [SIZE[0] - 16.0, HEIGHT[1] + 100.0], "end", &words);
}

fn words(technique: Technique) -> &'static str {
    match technique {
        Technique::FaceNormals => "face normals",
        Technique::DerivativeNormals => "derivative normals",
        Technique::Texture => "textures",
        Technique::Trilinear => "textures, trilinear",
        other => other.name(),
    }
}

/// Mid tones: at least 3 : 1 against white and against black.
fn color(technique: Technique) -> &'static str {
    const WIRES: [&str; 6] = ["#2f81f7", "#d9730d", "#a8800c", "#c545a8", "#768390", "#2da15f"];
    match technique {
        Technique::Wire(method) => WIRES[method as usize % WIRES.len()],
        Technique::Contour => "#2f81f7",
        Technique::Hull => "#d9730d",
        Technique::FaceNormals => "#2da15f",
        Technique::DerivativeNormals => "#c545a8",
        Technique::Trilinear => "#768390",
        Technique::Texture | Technique::TexturedFaces => "#a8800c",
        Technique::LitFaces | Technique::WiredFaces => "#2f81f7",
        Technique::SmoothFaces | Technique::OutlinedFaces => "#d9730d",
    }
}

fn dashes(back_end: &str) -> &'static str {
    match back_end {
        "cpu-1" => "",
        "cpu-2" => r#" stroke-dasharray="6 3""#,
        _ => r#" stroke-dasharray="2 3""#,
    }
}

fn number(v: f64) -> String {
    if v >= 1.0 { format!("{v:.0}") } else { format!("{v:.3}").trim_end_matches('0').to_owned() }
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
