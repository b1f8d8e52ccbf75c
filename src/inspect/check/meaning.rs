//! The sentence that says what each rule demands, by the name of the rule: "No face is without area." for
//! `no-degenerate`. Reports show it to readers who do not know the rules.

/// The sentence of a rule, by its name; empty for a name that is none.
pub fn meaning(rule: &str) -> &'static str {
    match rule {
        "opens" => "The file can be read and has something to draw.",
        "no-warnings" => "Reading the file gives no warnings.",
        "watertight" => "Every edge has two faces that run along it in opposite directions.",
        "manifold" => "No edge has more than two faces, and surfaces do not touch in a single vertex.",
        "consistent-winding" => "Neighbouring faces look to the same side.",
        "no-degenerate" => "No face is without area.",
        "no-duplicate-faces" => "No two faces have the same three corners.",
        "no-self-intersection" => "No two faces pass through each other.",
        "no-inverted-volume" => "No closed part is inside out.",
        "no-loose-vertices" => "Every vertex belongs to a face, a line or a point.",
        "no-ngons" => "No polygon has more than four corners.",
        "single-component" => "All faces are connected.",
        "has-normals" => "The file has vertex normals.",
        "has-uv" => "The file has texture coordinates.",
        "uv-in-range" => "Texture coordinates lie in the texture.",
        "uv-no-overlap" => "No two faces share a place in the texture.",
        "max-triangles" => "There are at most so many triangles.",
        "max-vertices" => "There are at most so many vertices, as the file counts them.",
        "max-materials" => "There are at most so many materials.",
        "max-texture-px" => "No texture is longer than this, in pixels.",
        "max-file-bytes" => "The file, with those that it refers to, is at most so large.",
        "bounds" => "The extents along x, y and z are at most these, in the file's units.",
        _ => "",
    }
}
