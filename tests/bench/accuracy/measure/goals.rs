//! The text of `docs/accuracy.md`: the goals, what was measured, and how to read the plots.

use std::fmt::Write;

use meshsnap_render::spec::{Samples, WireMethod};

use super::summary::{lead, point, range};
use super::table::{Machine, method};
use super::techniques::{Family, Technique};
use super::{BASELINE_SAMPLES, Effort, Row, SAMPLES, WHOLE_SAMPLES};

/// A measure, its goal and who measures it.
struct Goal {
    number: u32,
    measure: &'static str,
    goal: &'static str,
    by: By,
}

/// The program that measures a goal.
enum By {
    /// This benchmark, from its rows.
    Bench(fn(&[Row]) -> String),
    /// Tests of the suite. What stands in the page is kept, and marked as missing where nothing
    /// does.
    Suite(&'static str),
}

const GOALS: [Goal; 13] = [
    Goal {
        number: 1,
        measure: "isolated exact lines, 0.25 to 16 px wide, all angles, 64 places within a pixel",
        goal: "RMSE <= 0.35/255, largest <= 1/255, width +-0.005 px",
        by: By::Suite("accuracy::wires::isolated_lines"),
    },
    Goal {
        number: 2,
        measure: "exact wires in meshes, both back-ends",
        goal: "RMSE <= 1.5/255, ink 0.995 to 1.005",
        by: By::Bench(wires),
    },
    Goal { number: 3, measure: "lines on silhouettes", goal: "ink 0.99 to 1.01", by: By::Bench(silhouettes) },
    Goal {
        number: 4,
        measure: "triangles and lines with ends behind the eye",
        goal: "0.01 px, no false fill, no NaN",
        by: By::Suite("accuracy::behind_eye"),
    },
    Goal {
        number: 5,
        measure: "outlines of 1 to 32 px against the exact dilated contour",
        goal: "mean +-0.05 px, 99th percentile <= 0.25 px, no gaps",
        by: By::Suite("accuracy::outlines"),
    },
    Goal {
        number: 6,
        measure: "watertightness: 10^6 shared edges, fans, shells around the eye",
        goal: "0 missing, 0 double",
        by: By::Suite("accuracy::geometry"),
    },
    Goal {
        number: 7,
        measure: "the CPU's bytes: scalar, SIMD, any number of threads, any machine",
        goal: "identical",
        by: By::Suite("the_same_on_every_machine"),
    },
    Goal {
        number: 8,
        measure: "GPU against CPU",
        goal: "the same samples; colours within 1/255 in at most 0.1 % of pixels; FLIP <= 0.0005",
        by: By::Bench(twins),
    },
    Goal {
        number: 9,
        measure: "each skip on or off",
        goal: "identical bytes",
        by: By::Suite("skips::turning_a_skip_off_changes_no_byte"),
    },
    Goal {
        number: 10,
        measure: "exact wires against the next best technique",
        goal: "2x faster at equal error, or 5x less error at equal time",
        by: By::Bench(leads),
    },
    Goal {
        number: 11,
        measure: "pictures of faces, adaptive samples; mixed pixels show several faces, or a face and the background",
        goal: "mixed pixels RMSE <= 1.5/255, largest <= 16/255; whole pictures RMSE <= 0.5/255",
        by: By::Suite("accuracy::adaptive"),
    },
    Goal {
        number: 12,
        measure: "faces thinner than the distance of samples, adaptive samples: hairs, slivers, needles",
        goal: "ink 0.98 to 1.02",
        by: By::Suite("accuracy::adaptive::hairs"),
    },
    Goal {
        number: 13,
        measure: "textures at a slant against the mean over each pixel",
        goal: "at most a third of trilinear filtering's error",
        by: By::Suite("accuracy::textures"),
    },
];

/// The page. `before` is what stands there now.
pub fn page(rows: &[Row], machine: &Machine, effort: Effort, before: &str) -> String {
    let mut text = String::from(
        "# Accuracy\n\nWhat is true, and how far the pictures are from it. Truth is computed in f64 by `tests/oracle/`, which shares no \
         code with the renderers: a pixel is a unit square with a box filter, colour is blended in linear light, and a line is the set of \
         points within half its width of the visible part of an edge, with round ends. Errors are in steps of 1/255, over the \
         pixels that picture or truth touch. `cargo bench --bench accuracy -- --write` measures, and writes this page, \
         [accuracy.json](accuracy.json) (every row, with a schema) and the plots.\n\n## Goals\n\n| # | measure | goal | measured |\n|---|---|---|---|\n",
    );
    for goal in &GOALS {
        let measured = match goal.by {
            By::Bench(of) => of(rows),
            By::Suite(test) => kept(before, goal.number)
                .unwrap_or_else(|| format!("measured by: `cargo test --test suite {test} -- --nocapture`")),
        };
        let _ = writeln!(text, "| {} | {} | {} | {measured} |", goal.number, goal.measure, goal.goal);
    }
    let _ = writeln!(text, "\n{}.\n{}\n", machine.line(), method(effort));
    machine.warning().iter().for_each(|warning| {
        let _ = writeln!(text, "{warning}\n");
    });
    whole(&mut text, rows);
    text.push_str("## Techniques\n\n![Run time against error, by technique](work-precision.svg)\n\n");
    sentences(rows).iter().for_each(|sentence| {
        let _ = writeln!(text, "{sentence}");
    });
    text
}

/// The section of whole pictures: a plot, and the same as numbers.
fn whole(text: &mut String, rows: &[Row]) {
    text.push_str(
        "## Whole pictures: run time against error\n\n![Run time against error, of whole pictures](whole-pictures.svg)\n\nEdges count here as \
         much as what lies between them: RMSE of encoded colour, /255, of all pixels but those that are background in picture and truth. Each cell is a geometric mean over the \
         scenes: the error, and the time as a ratio to that of 4 samples. 64 samples are 16 in a picture of twice the columns and \
         rows, scaled down; the scaling is not timed.\n\n| picture | back-end |",
    );
    WHOLE_SAMPLES.iter().for_each(|samples| {
        let _ = write!(text, " {samples} |");
    });
    let _ = writeln!(text, "\n|---|---|{}", "---|".repeat(WHOLE_SAMPLES.len()));
    for family in [Family::Whole, Family::WholeTextures] {
        for (&technique, (id, name)) in family.techniques().iter().flat_map(|t| BACK_ENDS.map(|back_end| (t, back_end)))
        {
            let at = |samples| point(rows, family, technique, id, samples);
            let Some(usual) = at(BASELINE_SAMPLES) else { continue };
            let _ = write!(text, "| {} | {name} |", technique.name());
            for &samples in WHOLE_SAMPLES {
                let cell = at(samples).map_or_else(
                    || "16 instead".to_owned(),
                    |p| format!("{:.2} in {:.2}", p.error, p.time / usual.time),
                );
                let _ = write!(text, " {cell} |");
            }
            text.push('\n');
        }
    }
    text.push('\n');
}

/// The measurement that the page states for a goal.
fn kept(before: &str, number: u32) -> Option<String> {
    let line = before.lines().find(|line| line.starts_with(&format!("| {number} |")))?;
    let cell = line.trim_end().trim_end_matches('|').rsplit('|').next()?.trim();
    (!cell.is_empty() && !cell.starts_with("measured by:")).then(|| cell.to_owned())
}

const BACK_ENDS: [(&str, &str); 2] = [("cpu-1", "CPU"), ("gpu", "GPU")];

/// A cell that says something of each back-end that was measured.
fn each(of: impl Fn(&str) -> Option<String>) -> String {
    let known: Vec<String> = BACK_ENDS.iter().filter_map(|(id, name)| Some(format!("{name}: {}", of(id)?))).collect();
    if known.is_empty() { "not measured".to_owned() } else { known.join("; ") }
}

fn wires(rows: &[Row]) -> String {
    each(|back_end| {
        let [_, rmse] = range(rows, Technique::Wire(WireMethod::Exact), back_end, |row| Some(row.errors.rmse))?;
        let [low, high] = range(rows, Technique::Wire(WireMethod::Exact), back_end, |row| row.errors.ink)?;
        Some(format!("RMSE <= {rmse:.2}/255, ink {low:.4} to {high:.4}"))
    })
}

fn silhouettes(rows: &[Row]) -> String {
    each(|back_end| {
        let [low, high] = range(rows, Technique::Contour, back_end, |row| row.errors.ink)?;
        Some(format!("ink {low:.4} to {high:.4}"))
    })
}

fn twins(rows: &[Row]) -> String {
    let twins = || rows.iter().filter_map(|row| row.twin);
    if twins().next().is_none() {
        return "not measured".to_owned();
    }
    let share = twins().map(|t| t.share).fold(0.0, f64::max);
    let flip = twins().map(|t| t.flip).fold(0.0, f64::max);
    let max = twins().map(|t| t.max).max().unwrap_or(0);
    format!(
        "{} pictures: within {max}/255 in at most {:.3} % of pixels; FLIP <= {flip:.5}",
        twins().count(),
        100.0 * share
    )
}

fn leads(rows: &[Row]) -> String {
    each(|back_end| {
        let lead = lead(rows, back_end)?;
        Some(format!(
            "{:.0}x less error than {} in {:.2}x its time",
            lead.error_factor,
            lead.other.name(),
            lead.time_factor
        ))
    })
}

/// Six sentences that explain the plot with the numbers of these rows.
pub fn sentences(rows: &[Row]) -> [String; 6] {
    let at = |technique, samples: Samples| point(rows, Family::Wires, technique, "cpu-1", samples);
    let least = SAMPLES[0];
    let [exact_1, exact, fwidth_1, fwidth] = [
        at(Technique::Wire(WireMethod::Exact), least),
        at(Technique::Wire(WireMethod::Exact), BASELINE_SAMPLES),
        at(Technique::Wire(WireMethod::Fwidth), least),
        at(Technique::Wire(WireMethod::Fwidth), BASELINE_SAMPLES),
    ]
    .map(|p| p.map_or_else(|| "?".to_owned(), |p| format!("{:.2}/255 at time {:.2}", p.error, p.time)));
    let mean = |family, technique| point(rows, family, technique, "cpu-1", BASELINE_SAMPLES);
    let error = |family, technique| mean(family, technique).map_or(f64::NAN, |p| p.error);
    let time = |family, technique| mean(family, technique).map_or(f64::NAN, |p| p.time);
    [
        "Each line is one technique on one back-end, its points are numbers of samples per pixel, and each point is the geometric mean over \
         the scenes of its family, so that lower left is better."
            .to_owned(),
        format!(
            "Time 1 is exact wires on one thread of the CPU with {BASELINE_SAMPLES} samples on the same mesh, {:.1} ms in the mean over the \
             wire scenes.",
            at(Technique::Wire(WireMethod::Exact), BASELINE_SAMPLES).map_or(f64::NAN, |p| p.time_ms)
        ),
        format!("Exact wires on one thread err by {}.", leads_in_words(rows)),
        format!(
            "Samples decide which surface a pixel sees and smooth the other techniques, but cannot mend a wrong width: from {least} to \
             {BASELINE_SAMPLES} samples exact goes from {exact_1} to {exact}, fwidth from {fwidth_1} to {fwidth}."
        ),
        format!(
            "A contour errs by {:.2}/255 and a hull, against its own rule of how far it recedes, by {:.2}/255; where a pixel shows one face alone, normals by faces err \
             by {:.2}/255 (rounding to bytes leaves that much) and normals by derivatives by {:.2}/255 in {:.1} times the time.",
            error(Family::Outlines, Technique::Contour),
            error(Family::Outlines, Technique::Hull),
            error(Family::Faces, Technique::FaceNormals),
            error(Family::Faces, Technique::DerivativeNormals),
            time(Family::Faces, Technique::DerivativeNormals) / time(Family::Faces, Technique::FaceNormals),
        ),
        format!(
            "Textures err by {:.2}/255 where a pixel shows one face alone, against the mean of the texture over the pixel: {:.2} of what \
             trilinear filtering errs by, in {:.2} times the time of that.",
            error(Family::Textures, Technique::Texture),
            error(Family::Textures, Technique::Texture) / error(Family::Textures, Technique::Trilinear),
            time(Family::Textures, Technique::Texture) / time(Family::Textures, Technique::Trilinear),
        ),
    ]
}

fn leads_in_words(rows: &[Row]) -> String {
    let exact = point(rows, Family::Wires, Technique::Wire(WireMethod::Exact), "cpu-1", BASELINE_SAMPLES);
    match (exact, lead(rows, "cpu-1")) {
        (Some(exact), Some(lead)) => format!(
            "{:.2}/255, {:.0} times less than the next best, {}, in {:.2} times its time",
            exact.error,
            lead.error_factor,
            lead.other.name(),
            lead.time_factor
        ),
        _ => "an amount that was not measured".to_owned(),
    }
}
