//! Makes `src/render/plan/quality/error_table.json` from `docs/accuracy.json`: a row for each
//! technique that a request can ask for, on each kind of back-end with each number of samples. The
//! program chooses by this table where a request asks for an error or a time.

use std::fmt::Write;

use serde_json::{Value, json};

use super::BASELINE;
use super::techniques::Family;

/// Kinds of back-ends, and which of the measured ones stand for them.
const KINDS: [(&str, &str); 2] = [("cpu", "cpu-1"), ("gpu", "gpu")];

/// From the document that `json.rs` writes, so that a table can be made without measuring again.
pub fn table(document: &Value) -> String {
    // What a request may choose among: textures are filtered in one way, and whole pictures are made of several
    // techniques.
    let choices = [Family::Wires, Family::Outlines, Family::Faces].map(Family::techniques).concat();
    let is_choice = |row: &&Value| choices.iter().any(|technique| row["technique"] == technique.name());
    let rows: Vec<&Value> = document["rows"].as_array().expect("rows").iter().filter(is_choice).collect();
    let mut made: Vec<String> = Vec::new();
    for (kind, back_end) in KINDS {
        let rows: Vec<&Value> = rows.iter().copied().filter(|row| row["backend"] == back_end).collect();
        let alike = |technique: &Value, samples: &Value| -> Vec<&Value> {
            let is_alike = |r: &&Value| r["technique"] == *technique && r["samples"] == *samples;
            rows.iter().copied().filter(is_alike).collect()
        };
        let mut seen: Vec<(&Value, &Value)> = Vec::new();
        for &row in &rows {
            let key = (&row["technique"], &row["samples"]);
            if seen.contains(&key) {
                continue;
            }
            seen.push(key);
            let of_row = alike(key.0, key.1);
            let error = of_row.iter().map(|r| r["rmse"].as_f64().expect("rmse")).fold(0.0, f64::max);
            let least = least_ms_per_kilotriangle(document, rows.iter().copied().filter(|r| r["samples"] == *key.1));
            let rounded = |v: f64| format!("{v:.3e}").parse::<f64>().expect("a number");
            let [per_pixel, per_triangle] = fit(&points(document, &of_row), least).map(rounded);
            let row = json!({
                "technique": key.0, "backend": kind, "samples": key.1, "error": error,
                "ms_per_megapixel": per_pixel, "ms_per_kilotriangle": per_triangle,
            });
            made.push(format!("    {row}"));
        }
    }
    let gpu = document["machine"]["gpu"].as_str();
    let mut text = String::from("{\n");
    let parts = [
        ("about", json!(about())),
        ("machine", document["machine"].clone()),
        ("size_px", document["size_px"].clone()),
        ("gpu_is_software", json!(gpu.is_some_and(|gpu| gpu.contains("(software,")))),
    ];
    for (name, value) in parts {
        let _ = writeln!(text, "  \"{name}\": {value},");
    }
    let _ = write!(text, "  \"rows\": [\n{}\n  ]\n}}\n", made.join(",\n"));
    text
}

fn about() -> String {
    format!(
        "Written by `cargo bench --bench accuracy -- --write`, or with --table-only from docs/accuracy.json. error: the largest RMSE \
         (/255) of the technique's scenes, since a promise must hold for the worst of them. Times: least squares of relative errors \
         through the scenes' medians, on this machine, which other machines differ from; cpu is one thread. A triangle takes at least \
         the smallest time above 0 that was found for any technique on that kind of back-end with as many samples. There are pictures of \
         one size alone, so what a picture costs whatever it shows counts as its pixels'. The benchmark's baseline: {BASELINE}."
    )
}

/// The smallest time above 0 that a thousand triangles take with any technique of some rows, milliseconds.
///
/// No technique draws triangles in no time. A fit may say so where pixels take long and scenes are few: scenes also differ
/// by how much of the picture they fill.
fn least_ms_per_kilotriangle<'a>(document: &Value, rows: impl Iterator<Item = &'a Value> + Clone) -> f64 {
    let fitted = rows.clone().map(|row| {
        let alike: Vec<&Value> = rows.clone().filter(|r| r["technique"] == row["technique"]).collect();
        fit(&points(document, &alike), 0.0)[1]
    });
    fitted.filter(|&ms| ms > 0.0).min_by(f64::total_cmp).unwrap_or(0.0)
}

/// Megapixels, thousands of triangles and milliseconds of some rows.
fn points(document: &Value, rows: &[&Value]) -> Vec<[f64; 3]> {
    let scenes = document["scenes"].as_array().expect("scenes");
    let megapixels = document["size_px"].as_f64().expect("size_px").powi(2) / 1e6;
    let point = |row: &&Value| {
        let scene = scenes.iter().find(|scene| scene["name"] == row["scene"]).expect("a scene of every row");
        let triangles = scene["triangles"].as_f64().expect("triangles");
        [megapixels, triangles / 1e3, row["median_ms"].as_f64().expect("median_ms")]
    };
    rows.iter().map(point).collect()
}

/// The a >= 0 and b >= b_min that make a p + b t nearest to ms, for points [p, t, ms], in squares of relative
/// errors.
pub fn fit(points: &[[f64; 3]], b_min: f64) -> [f64; 2] {
    let sum = |f: fn(f64, f64) -> f64| points.iter().map(|[p, t, ms]| f(p / ms, t / ms)).sum::<f64>();
    let (pp, pt, tt, p, t) = (sum(|p, _| p * p), sum(|p, t| p * t), sum(|_, t| t * t), sum(|p, _| p), sum(|_, t| t));
    let determinant = pp * tt - pt * pt;
    let [a, b] = [p * tt - t * pt, t * pp - p * pt].map(|v| v / determinant);
    match (a > 0.0, b > b_min) {
        (true, true) => [a, b],
        (false, true) => [0.0, (t / tt).max(b_min)],
        _ => [((p - b_min * pt) / pp).max(0.0), b_min],
    }
}
