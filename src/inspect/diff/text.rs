//! The difference between two meshes as text for a person: whether they are the same, the sentences of the summary,
//! the largest and the mean distance unless they are 0, and a line for each count, and for size, area and volume,
//! that differs.

use std::fmt::Write as _;

use super::{Counts, Difference, Geometry, Size};

impl Difference {
    /// The summary, the distance, then a line for each count and measure that differs.
    pub fn text(&self) -> String {
        let mut text = String::from(if self.same { "same\n" } else { "different\n" });
        for sentence in &self.summary {
            let _ = writeln!(text, "  {sentence}");
        }
        self.geometry.text(&mut text);
        let [a, b] = [self.counts.a, self.counts.b].map(Counts::named);
        let [size_a, size_b] = [self.measures.a, self.measures.b].map(Size::named);
        for ((name, before), (_, now)) in a.into_iter().chain(size_a).zip(b.into_iter().chain(size_b)) {
            if before != now {
                let _ = writeln!(text, "{name:<11}{before} -> {now}");
            }
        }
        text
    }
}

impl Geometry {
    fn text(&self, text: &mut String) {
        let (Some(max), Some(mean)) = (self.hausdorff, self.mean) else { return };
        if max > 0.0 {
            let error = self.stated_error.filter(|error| *error > 0.0);
            let error = error.map(|error| format!(" (at most {error} more between vertices)")).unwrap_or_default();
            let _ = writeln!(text, "{:<11}at most {max}{error}, mean {mean}", "distance");
        }
    }
}

impl Counts {
    fn named(self) -> [(&'static str, String); 4] {
        let Self { triangles, vertices, lines_and_points, materials } = self;
        [
            ("triangles", triangles.to_string()),
            ("vertices", vertices.to_string()),
            ("lines", lines_and_points.to_string()),
            ("materials", materials.to_string()),
        ]
    }
}

impl Size {
    fn named(self) -> [(&'static str, String); 3] {
        let number = |value: Option<f64>| value.map_or("none".to_owned(), |value| rounded(value).to_string());
        let [x, y, z] = self.bounds.size;
        [("size", format!("{x} x {y} x {z}")), ("area", number(self.area)), ("volume", number(self.volume))]
    }
}

/// Six digits, below which areas and volumes change with the order of their sums.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}
