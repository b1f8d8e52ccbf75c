//! The files of shaders/, and which of them a kernel consists of.
//!
//! WGSL has no include. The head of each file says which others it uses, and what of them: `// Uses: a.wgsl (x, y),
//! b.wgsl or c.wgsl (z).` A kernel is its own file, the files that this one uses, those that they use, and so on. Of
//! files with an `or` between them it has one: the one that the caller has chosen, or else its own file or the first.

/// The text of each file, by its path in shaders/.
macro_rules! files {
    ($($path:literal)*) => { &[$(($path, include_str!(concat!("../../../shaders/", $path)))),*] };
}

/// Path and text of every file.
pub const FILES: &[(&str, &str)] = files![
    "common.wgsl" "encode.wgsl" "gang.wgsl" "one_job.wgsl" "over.wgsl" "resolve.wgsl"
    "geometry/clip.wgsl" "geometry/corners.wgsl" "geometry/culling.wgsl" "geometry/planes.wgsl"
    "geometry/small.wgsl" "geometry/steepness.wgsl" "geometry/tile.wgsl" "geometry/tile_samples.wgsl"
    "geometry/transform.wgsl" "geometry/triangle.wgsl" "geometry/visibility.wgsl" "geometry/visibility_few.wgsl"
    "geometry/visibility_tile.wgsl" "geometry/work.wgsl"
    "lines/contour.wgsl" "lines/coplanar.wgsl" "lines/coverage.wgsl" "lines/edge.wgsl" "lines/fringed.wgsl"
    "lines/fringes.wgsl" "lines/hidden_lines.wgsl"
    "lines/lattice.wgsl" "lines/line_light.wgsl" "lines/seen.wgsl" "lines/segment.wgsl" "lines/stroke.wgsl"
    "lines/stroke_words.wgsl"
    "lines/holes/free_points.wgsl" "lines/holes/holes.wgsl" "lines/holes/inset.wgsl" "lines/holes/marks.wgsl"
    "lines/holes/tips.wgsl"
    "mixed/lattice.wgsl" "mixed/lists.wgsl" "mixed/mixed_color.wgsl" "mixed/mixed_parts.wgsl"
    "mixed/mixed_shade.wgsl" "mixed/mixed_sum.wgsl" "mixed/place.wgsl" "mixed/point_edges.wgsl"
    "mixed/point_sets.wgsl" "mixed/points.wgsl" "mixed/share_color.wgsl" "mixed/shares.wgsl"
    "mixed/find/breaks.wgsl" "mixed/find/look.wgsl" "mixed/find/mixed_pixels.wgsl" "mixed/find/seen_faces.wgsl"
    "mixed/find/thin.wgsl"
    "occlusion/gather.wgsl" "occlusion/grid.wgsl" "occlusion/place.wgsl" "occlusion/spread.wgsl"
    "peeling/composite.wgsl" "peeling/emit_layer.wgsl" "peeling/rounds.wgsl" "peeling/state.wgsl"
    "peeling/tints.wgsl"
    "samples/emit.wgsl" "samples/samples.wgsl" "samples/samples32.wgsl" "samples/samples64.wgsl"
    "surface/barycentric.wgsl" "surface/debug.wgsl" "surface/group.wgsl" "surface/hull.wgsl" "surface/light.wgsl"
    "surface/material.wgsl" "surface/normal.wgsl" "surface/occlusion_texture.wgsl" "surface/paint.wgsl"
    "surface/point.wgsl" "surface/shade.wgsl" "surface/texture.wgsl" "surface/wire.wgsl"
];

/// The files of the kernel with this entry point, its own first. Where a head names alternatives, it has the one in
/// `chosen`, or its own file if that is among them, or else the first.
pub fn files_of(entry: &str, chosen: &[&str]) -> Vec<&'static str> {
    let is_own = |path: &str| path.rsplit('/').next().and_then(|name| name.strip_suffix(".wgsl")) == Some(entry);
    let mut paths: Vec<_> = FILES.iter().map(|(path, _)| *path).filter(|path| is_own(path)).collect();
    let mut next = 0;
    while let Some(path) = paths.get(next) {
        for alternatives in uses(text_of(path)) {
            let is_wanted = |path: &&&str| chosen.contains(*path) || is_own(path);
            let used = alternatives.iter().find(is_wanted).or(alternatives.first());
            paths.extend(used.filter(|path| !paths.contains(path)));
        }
        next += 1;
    }
    paths
}

/// The text of a file.
pub fn text_of(path: &str) -> &'static str {
    FILES.iter().find(|(other, _)| *other == path).map_or("", |(_, text)| *text)
}

/// The files that the head of a file names: alternatives, which `or` joins, together.
fn uses(text: &str) -> Vec<Vec<&str>> {
    let head = text.lines().map_while(|line| line.strip_prefix("//")).flat_map(str::split_whitespace);
    let mut all: Vec<Vec<_>> = Vec::new();
    let mut before = "";
    for word in head.skip_while(|word| *word != "Uses:") {
        match all.last_mut() {
            _ if !word.ends_with(".wgsl") => {}
            Some(alternatives) if before == "or" => alternatives.push(word),
            _ => all.push(vec![word]),
        }
        before = word;
    }
    all
}
