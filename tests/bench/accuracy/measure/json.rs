//! `docs/accuracy.json`: the measured rows, and in the document itself what each field means.

use std::fmt::Write;

use meshsnap_render::spec::Samples;
use serde_json::{Value, json};

use super::scenes::Scene;
use super::table::{Machine, method};
use super::{BASELINE, Effort, Row};

/// A document, a line a row, so that two runs can be compared line by line.
pub fn document(machine: &Machine, effort: Effort, scenes: &[Scene], rows: &[Row]) -> String {
    let scene = |scene: &Scene| {
        let triangles = rows.iter().find(|row| row.scene == scene.name).map(|row| row.triangles);
        json!({ "name": scene.name, "family": scene.family.name(), "about": scene.about(), "triangles": triangles })
    };
    let parts = [
        ("schema", schema()),
        ("machine", json!({ "cpu": machine.cpu, "cores": machine.cores, "gpu": machine.gpu, "load": machine.load })),
        ("method", json!(method(effort))),
        ("baseline", json!(BASELINE)),
        ("size_px", json!(effort.size_px)),
        ("runs", json!(effort.runs)),
    ];
    let mut text = String::from("{\n");
    for (name, value) in parts {
        let value = serde_json::to_string_pretty(&value).unwrap_or_default().replace('\n', "\n  ");
        let _ = writeln!(text, "  \"{name}\": {value},");
    }
    list(&mut text, "scenes", scenes.iter().map(scene));
    text.push_str(",\n");
    list(&mut text, "rows", rows.iter().map(row));
    text.push_str("\n}\n");
    text
}

fn list(text: &mut String, name: &str, values: impl Iterator<Item = Value>) {
    let lines: Vec<String> = values.map(|v| format!("    {v}")).collect();
    let _ = write!(text, "  \"{name}\": [\n{}\n  ]", lines.join(",\n"));
}

fn row(row: &Row) -> Value {
    let errors = &row.errors;
    let mut value = json!({
        "scene": row.scene,
        "technique": row.technique.name(),
        "backend": row.back_end,
        "samples": match row.samples {
            Samples::Fixed(samples) => json!(samples),
            other => json!(other.to_string()),
        },
        "thickness": short(row.thickness),
        "median_ms": short(row.median_ms),
        "time_ratio": short(row.time_ratio),
        "rmse": short(errors.rmse),
        "max": short(errors.max),
        "flip": short(errors.flip),
        "pixels": errors.pixels,
    });
    if let Some(ink) = errors.ink {
        value["ink"] = short(ink);
    }
    if let Some(twin) = &row.twin {
        value["twin"] = json!({ "share": short(twin.share), "max": twin.max, "flip": short(twin.flip) });
    }
    value
}

/// Five digits: more would only say how the day was.
fn short(v: f64) -> Value {
    format!("{v:.4e}").parse::<f64>().map_or(Value::Null, |v| json!(v))
}

fn schema() -> Value {
    json!({
        "machine": "models of the processor and the GPU (null: none that speaks Vulkan), cores that could be used, and the \
                    load average over a minute before the first round",
        "method": "how pictures and times were taken",
        "baseline": "what every time_ratio is relative to, on the same scene's mesh in the same rounds",
        "size_px": "columns and rows of every picture",
        "runs": "timed rounds",
        "scenes[].family": "wires and outlines: errors of coverage, in linear light; faces: of encoded colour where a pixel shows one face \
                            alone; pictures, whole pictures, whole textured pictures: of encoded colour in all pixels; textures: of encoded colour where a pixel \
                            shows one face alone",
        "scenes[].triangles": "after triangulation",
        "rows[].technique": "wire.method, outline.method or surface.normals of the request; texture: filtering, without light; trilinear: the same by one place of each pixel; of whole pictures: what \
                             is drawn",
        "rows[].backend": "cpu-N with N threads, or gpu",
        "rows[].samples": "image.samples; 64: 16 in a picture of twice the columns and rows, scaled down, which is not timed",
        "rows[].thickness": "wire.thickness or outline.thickness (px), chosen so that the technique is nominally as wide as the truth",
        "rows[].median_ms": "median time of Renderer::draw",
        "rows[].time_ratio": "median_ms over that of the baseline",
        "rows[].rmse": "root mean square error over the pixels that drawing or truth touch, /255",
        "rows[].max": "largest error, /255",
        "rows[].flip": "mean LDR-FLIP (Andersson et al. 2020) at 67 pixels a degree over the whole picture, lines black on white",
        "rows[].pixels": "how many pixels count for rmse",
        "rows[].ink": "drawn coverage as a share of the true one; of lines alone",
        "rows[].twin": "of the GPU's picture against the CPU's: share of pixels that differ at all, largest difference of a channel /255, \
                        mean FLIP"
    })
}
