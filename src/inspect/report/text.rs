//! The report as text for a person: a name and a value per line. The sections that are optional
//! (print, parts, UV charts) make their text themselves.

use super::{Arity, CameraReport, Report, TextureReport, significant};
use meshsnap_render::pluralise::pluralise;
use std::fmt::Write as _;

/// The most entries of a list that are written out.
const SHOWN_MAX: usize = 40;

/// The report as text. Properties without a value have no line.
pub fn text(report: &Report) -> String {
    let mut out = String::new();
    let mut line = |name: &str, value: Option<String>| {
        // Writing to a string cannot fail.
        let _ = value.map(|value| writeln!(out, "{name:<12} {value}"));
    };
    let point = |p: [f64; 3]| p.map(plain).join(" ");
    line("format", Some(format!("{} ({} bytes)", report.format, report.file_bytes)));
    line("generator", report.generator.clone());
    line("scene", scene(report));
    line("vertices", Some(format!("{} in the file, {} different positions", report.file_vertices, report.positions)));
    line("triangles", Some(report.triangles.to_string()));
    let arity = |a: &Arity| format!("{} x {}{}", a.count, a.corners, if a.corners == 12 { "+" } else { "" });
    let arities: Vec<String> = report.polygons_by_arity.iter().map(arity).collect();
    let arities = if arities.is_empty() { String::new() } else { format!(" ({} corners)", arities.join(", ")) };
    line("polygons", Some(format!("{}{arities}", report.polygons)));
    line("beside", beside(report));
    let attributes = [(report.has_normals, "normals"), (report.has_uvs, "UVs"), (report.has_colors, "colours")];
    let attributes: Vec<&str> = attributes.into_iter().filter_map(|(has, name)| has.then_some(name)).collect();
    line("attributes", Some(if attributes.is_empty() { "none".into() } else { attributes.join(", ") }));
    let name = |m: &String| if m.is_empty() { "(unnamed)".to_owned() } else { printable(m) };
    line("materials", Some(list(&report.materials, name)));
    line("textures", (!report.textures.is_empty()).then(|| list(&report.textures, texture)));
    line("cameras", (!report.scene_cameras.is_empty()).then(|| list(&report.scene_cameras, camera)));
    line("extensions", extensions(report));
    line("bounds", Some(format!("{} to {}", point(report.bounds.min), point(report.bounds.max))));
    line("size", Some(format!("{}, {} up", point(report.bounds.size), report.up)));
    line("measures", measures(report));
    line("topology", Some(report.topology.text()));
    line("faults", report.topology.faults());
    line("dropped", dropped(report));
    for warning in &report.warnings {
        line("warning", Some(format!("{} ({})", warning.detail, warning.code)));
    }
    out
}

fn scene(report: &Report) -> Option<String> {
    let counts = [
        (report.scenes, "scene", "scenes"),
        (report.nodes, "node", "nodes"),
        (report.meshes, "mesh", "meshes"),
        (report.primitives, "primitive", "primitives"),
        (report.animations.filter(|n| *n > 0), "animation", "animations"),
        (report.skins.filter(|n| *n > 0), "skin", "skins"),
        (report.cameras.filter(|n| *n > 0), "camera", "cameras"),
    ];
    joined(counts.into_iter().filter_map(|(count, one, more)| Some(pluralise(count?, one, more))))
}

/// Lines and points, which lie beside the faces.
fn beside(report: &Report) -> Option<String> {
    let counts = [(report.lines, "line", "lines"), (report.points, "point", "points")];
    joined(counts.into_iter().filter(|(count, ..)| *count > 0).map(|(count, one, more)| pluralise(count, one, more)))
}

fn texture(texture: &TextureReport) -> String {
    let name = printable(&texture.name);
    match (texture.format, texture.width_px.zip(texture.height_px)) {
        (Some(format), Some((width, height))) => format!("{name} {width}x{height} {format}"),
        _ if texture.file_bytes.is_some() => format!("{name} (unreadable)"),
        _ => format!("{name} (missing)"),
    }
}

fn camera(camera: &CameraReport) -> String {
    let name = if camera.name.is_empty() { "(unnamed)".to_owned() } else { printable(&camera.name) };
    match (camera.fov_deg, camera.height) {
        (Some(fov_deg), _) => format!("{name} ({}, {fov_deg:.1} degrees)", camera.projection),
        (None, Some(height)) => format!("{name} ({}, height {})", camera.projection, plain(height)),
        (None, None) => format!("{name} ({})", camera.projection),
    }
}

fn extensions(report: &Report) -> Option<String> {
    let required = |name: &String| report.extensions_required.contains(name);
    let name = |name: &String| format!("{name}{}", if required(name) { " (required)" } else { "" });
    (!report.extensions_used.is_empty()).then(|| list(&report.extensions_used, name))
}

fn measures(report: &Report) -> Option<String> {
    // Positions have 24 bits.
    let digits = |value| significant(value, 7);
    let area = report.area.map(|area| format!("area {}", plain(digits(area))));
    let volume = report
        .volume
        .map(|volume| format!("volume {}{}", plain(digits(volume)), if volume < 0.0 { " (inside out)" } else { "" }));
    joined(area.into_iter().chain(volume))
}

/// A number in decimal notation, or with an exponent where that would take more than about 16
/// digits.
fn plain(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-9..1e16).contains(&size) { value.to_string() } else { format!("{value:e}") }
}

/// Faces, lines and points that are not drawn, with the reason.
fn dropped(report: &Report) -> Option<String> {
    let reasons = [
        (report.dropped_nonfinite_faces, "with NaN or infinite corners"),
        (report.dropped_degenerate_faces, "without area"),
        (report.dropped_collapsed_faces, "too small beside the whole mesh"),
    ];
    let met = reasons.into_iter().filter(|(count, _)| *count > 0);
    let faces = met.map(|(count, why)| format!("{} {why}", pluralise(count, "face", "faces")));
    let primitives = Some(report.dropped_loose).filter(|count| *count > 0);
    joined(faces.chain(primitives.map(|count| pluralise(count, "line or point", "lines and points"))))
}

/// All parts in one line; None where there is none.
fn joined(parts: impl Iterator<Item = String>) -> Option<String> {
    let parts: Vec<String> = parts.collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

fn list<T>(all: &[T], name: impl Fn(&T) -> String) -> String {
    let mut shown: Vec<String> = all.iter().take(SHOWN_MAX).map(name).collect();
    if all.len() > SHOWN_MAX {
        shown.push(format!("and {} more", all.len() - SHOWN_MAX));
    }
    shown.join(", ")
}

/// A name from the file without control characters, which could move a terminal's cursor.
fn printable(name: &str) -> String {
    name.chars().take(200).map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_never_hundreds_of_digits() {
        let cases = [
            (0.0, "0"),
            (-2.5, "-2.5"),
            (1e15, "1000000000000000"),
            (1e300, "1e300"),
            (-1.25e-200, "-1.25e-200"),
            (f64::MAX, "1.7976931348623157e308"),
        ];
        for (value, expected) in cases {
            assert_eq!(plain(value), expected);
        }
        assert_eq!(cases.len(), 6);
    }
}
