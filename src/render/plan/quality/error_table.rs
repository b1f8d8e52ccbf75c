//! The table of measured errors and times, `error_table.json`, as `quality` reads it. It has rows by
//! drawing technique (a way to draw surfaces, wires or outlines), back-end and number of samples. From
//! these rows follow the error and the time to expect of a picture of any size. The benchmark writes
//! the table (`cargo bench --bench accuracy -- --write`), whose key `about` explains its numbers.

use std::sync::LazyLock;

use serde::Deserialize;

use crate::spec::{ADAPTIVE, Samples};

/// Everything that was measured.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct ErrorTable {
    /// True if the measured GPU is software. It then says nothing about one that `auto` would draw
    /// on.
    pub gpu_is_software: bool,
    /// Columns and rows of the measured pictures.
    size_px: f64,
    rows: Vec<Row>,
}

/// A number of samples, or the word for adaptive ones.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "serde_json::Value")]
struct TableSamples(Samples);

impl TryFrom<serde_json::Value> for TableSamples {
    type Error = String;

    fn try_from(value: serde_json::Value) -> Result<Self, String> {
        let number = value.as_u64().and_then(|number| u32::try_from(number).ok());
        match number {
            Some(number) if Samples::FIXED.contains(&number) => Ok(Self(Samples::Fixed(number))),
            None if value == ADAPTIVE => Ok(Self(Samples::Adaptive)),
            _ => Err(format!("{value} is no number of samples")),
        }
    }
}

/// A technique on a kind of back-end with a number of samples.
#[derive(Clone, Debug, Deserialize)]
pub struct Row {
    technique: String,
    backend: String,
    samples: TableSamples,
    /// The largest RMSE of its scenes, /255.
    error: f64,
    ms_per_megapixel: f64,
    ms_per_kilotriangle: f64,
}

impl ErrorTable {
    /// The table that this program was built with; empty if it cannot be read, which a test rules
    /// out.
    pub fn shipped() -> &'static Self {
        static SHIPPED: LazyLock<ErrorTable> =
            LazyLock::new(|| serde_json::from_str(include_str!("error_table.json")).unwrap_or_default());
        &SHIPPED
    }

    /// The row of a technique on the back-end of this name; the CPU's row where the table has no
    /// GPU, since their pictures agree.
    ///
    /// With adaptive samples, techniques that do not get better by them have the row of the samples that all pixels
    /// of opaque pictures have.
    pub fn row(&self, technique: &str, backend: &str, samples: Samples) -> Option<&Row> {
        let find = |backend: &str, samples: Samples| {
            let is_it = |row: &&Row| row.technique == technique && row.backend == backend && row.samples.0 == samples;
            self.rows.iter().find(is_it)
        };
        let of = |samples: Samples| find(backend, samples).or_else(|| find("cpu", samples));
        of(samples).or_else(|| of(Samples::Fixed(samples.per_pixel())))
    }

    /// The expected error of a picture of so many pixels, RMSE in /255.
    ///
    /// Errors of filled pictures are at edges. Their number grows with the picture's side and its
    /// area with the square of the side, so the mean square goes with 1 / side. Lines of one mesh
    /// meet in a larger share of the pixels as these get fewer, with about the same effect.
    /// A contour errs most where faces without a sample hide it. The smaller the picture, the more
    /// such faces there are, beside fewer pixels of line: its mean square goes with 1 / side^2.
    /// Pictures larger than the measured ones get no smaller error, since finer meshes go with
    /// them.
    pub fn error(&self, row: &Row, pixels: f64) -> f64 {
        let smaller = (self.size_px / pixels.sqrt()).max(1.0);
        let growth = if row.technique == "contour" { smaller } else { smaller.sqrt() };
        (row.error * growth).min(255.0)
    }

    /// True if a GPU was measured that is not software.
    pub fn knows_gpu(&self) -> bool {
        !self.gpu_is_software && self.rows.iter().any(|row| row.backend == "gpu")
    }
}

impl Row {
    /// The expected time, milliseconds.
    pub fn time_ms(&self, pixels: f64, triangles: f64) -> f64 {
        self.ms_per_megapixel * pixels / 1e6 + self.ms_per_kilotriangle * triangles / 1e3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_table_knows_every_technique() {
        let table = ErrorTable::shipped();
        let wires = crate::spec::WIRE_METHODS.iter().map(|row| row.name);
        let techniques: Vec<&str> = wires.chain(["contour", "hull", "face", "derivative"]).collect();
        let mut found = 0;
        for technique in techniques {
            for backend in ["cpu", "gpu"] {
                for samples in [1, 4, 8, 16].map(Samples::Fixed).into_iter().chain([Samples::Adaptive]) {
                    let row = table.row(technique, backend, samples).unwrap();
                    let [thumbnail, measured, large] = [64.0, 512.0, 2048.0].map(|s: f64| table.error(row, s * s));
                    assert!(measured > 0.0 && measured <= thumbnail && thumbnail <= 255.0, "{row:?}");
                    assert_eq!(measured, large);
                    assert!(row.ms_per_megapixel > 0.0 && row.ms_per_kilotriangle > 0.0, "{row:?}");
                    assert!(row.time_ms(1e6, 1e3) > 0.0, "{row:?}");
                    found += 1;
                }
            }
        }
        assert_eq!(found, 90);
    }
}
