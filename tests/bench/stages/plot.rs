//! The plot of time against triangles as SVG, both logarithmic.

use std::fmt::Write as _;

/// A measured time.
pub struct Point {
    pub series: &'static str,
    pub triangles: f64,
    pub ms: f64,
}

/// Left, right, top and bottom of the plot.
const BOX: [f64; 4] = [64.0, 520.0, 36.0, 330.0];

/// Colours that are told apart on white and on black.
const COLORS: [&str; 3] = ["#8c96a3", "#2f7fd6", "#d9622b"];

/// Decades along an axis, from the first to the last, and its ends on screen.
struct Axis {
    decades: [i32; 2],
    ends: [f64; 2],
}

impl Axis {
    fn around(values: impl Iterator<Item = f64> + Clone, ends: [f64; 2]) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min).log10().floor() as i32;
        let high = values.fold(f64::NEG_INFINITY, f64::max).log10().ceil() as i32;
        Self { decades: [low, high.max(low + 1)], ends }
    }

    fn at(&self, v: f64) -> f64 {
        let [low, high] = self.decades.map(f64::from);
        self.ends[0] + (v.log10() - low) / (high - low) * (self.ends[1] - self.ends[0])
    }
}

/// One line for each series.
pub fn svg(points: &[Point]) -> String {
    let [left, right, top, bottom] = BOX;
    let x = Axis::around(points.iter().map(|p| p.triangles), [left, right]);
    let y = Axis::around(points.iter().map(|p| p.ms), [bottom, top]);
    let mut text = String::new();
    let out = &mut text;
    writeln!(
        out,
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="640" height="390" font-family="sans-serif" font-size="12">"#
    )
    .unwrap();
    writeln!(out, r##"<rect width="100%" height="100%" fill="#ffffff"/>"##).unwrap();
    writeln!(out, r#"<text x="{left}" y="20" font-weight="bold">512 x 512 px, 4 samples, CPU: ms by triangles</text>"#)
        .unwrap();
    for decade in x.decades[0]..=x.decades[1] {
        let at = x.at(10_f64.powi(decade));
        writeln!(out, r##"<path d="M{at:.1} {top}V{bottom}" stroke="#e3e6ea"/><text x="{at:.1}" y="{}" text-anchor="middle">1e{decade}</text>"##, bottom + 18.0).unwrap();
    }
    for decade in y.decades[0]..=y.decades[1] {
        let at = y.at(10_f64.powi(decade));
        let label = 10_f64.powi(decade);
        writeln!(out, r##"<path d="M{left} {at:.1}H{right}" stroke="#e3e6ea"/><text x="{}" y="{:.1}" text-anchor="end">{label}</text>"##, left - 8.0, at + 4.0).unwrap();
    }
    let mut names: Vec<&str> = Vec::new();
    for point in points {
        if !names.contains(&point.series) {
            names.push(point.series);
        }
    }
    for (name, color) in names.iter().zip(COLORS.iter().cycle()) {
        let own: Vec<(f64, f64)> =
            points.iter().filter(|p| p.series == *name).map(|p| (x.at(p.triangles), y.at(p.ms))).collect();
        let way: Vec<String> = own.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        writeln!(out, r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="2"/>"#, way.join(" "))
            .unwrap();
        for (x, y) in &own {
            writeln!(out, r#"<circle cx="{x:.1}" cy="{y:.1}" r="3" fill="{color}"/>"#).unwrap();
        }
        if let Some((x, y)) = own.last() {
            writeln!(out, r#"<text x="{:.1}" y="{:.1}" fill="{color}">{name}</text>"#, x + 8.0, y + 4.0).unwrap();
        }
    }
    text.push_str("</svg>\n");
    text
}
