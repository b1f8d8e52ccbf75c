//! Summaries of the measured rows: geometric means over a family's scenes, which are the points of
//! the plots, and the lead of exact wires over the next best technique.

use meshsnap_render::spec::{Samples, WireMethod};

use super::Row;
use super::techniques::{Family, Technique};

/// A technique on a back-end with a number of samples: geometric means over a family's scenes.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub samples: Samples,
    /// Time as a ratio to the baseline's.
    pub time: f64,
    /// RMSE, /255.
    pub error: f64,
    /// Milliseconds.
    pub time_ms: f64,
}

/// A technique on a back-end, by the number of samples.
#[derive(Clone, Debug)]
pub struct Series {
    pub family: Family,
    pub technique: Technique,
    pub back_end: &'static str,
    pub points: Vec<Point>,
}

/// Errors below this (/255) are drawn and averaged as this: nothing that is stored in 8 bits is
/// nearer to the truth in the mean.
const ERROR_MIN: f64 = 0.05;

/// Every technique of a family on every back-end.
pub fn series(rows: &[Row], family: Family) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for row in rows.iter().filter(|row| row.family == family) {
        if !all.iter().any(|s| s.technique == row.technique && s.back_end == row.back_end) {
            let (technique, back_end) = (row.technique, row.back_end);
            let of = |samples| point(rows, family, technique, back_end, samples);
            let points = family.samples().iter().filter_map(|&samples| of(samples)).collect();
            all.push(Series { family, technique, back_end, points });
        }
    }
    all
}

/// The mean over the family's scenes; None where there is nothing to take a mean of.
pub fn point(rows: &[Row], family: Family, technique: Technique, back_end: &str, samples: Samples) -> Option<Point> {
    let is_of =
        |row: &&Row| (row.family, row.technique, row.back_end, row.samples) == (family, technique, back_end, samples);
    let chosen: Vec<&Row> = rows.iter().filter(is_of).collect();
    let mean = |of: fn(&Row) -> f64| geometric_mean(chosen.iter().map(|row| of(row)));
    (!chosen.is_empty()).then(|| Point {
        samples,
        time: mean(|row| row.time_ratio),
        error: mean(|row| row.errors.rmse.max(ERROR_MIN)),
        time_ms: mean(|row| row.median_ms),
    })
}

/// Exact wires against the one of the others that errs least, on a back-end.
#[derive(Clone, Copy, Debug)]
pub struct Lead {
    pub other: Technique,
    /// The other's error over the exact one's.
    pub error_factor: f64,
    /// The exact one's time over the other's.
    pub time_factor: f64,
}

/// At the samples of the baseline; None where wires were not measured there.
pub fn lead(rows: &[Row], back_end: &str) -> Option<Lead> {
    let at = |technique| point(rows, Family::Wires, technique, back_end, super::BASELINE_SAMPLES);
    let exact = at(Technique::Wire(WireMethod::Exact))?;
    let others = Family::Wires.techniques().iter().filter(|&&t| t != Technique::Wire(WireMethod::Exact));
    let (other, best) =
        others.filter_map(|&t| Some((t, at(t)?))).min_by(|(_, a), (_, b)| a.error.total_cmp(&b.error))?;
    Some(Lead { other, error_factor: best.error / exact.error, time_factor: exact.time / best.time })
}

/// The smallest and the largest of something over the rows of a technique on a back-end; None where
/// there are none.
pub fn range(rows: &[Row], technique: Technique, back_end: &str, of: impl Fn(&Row) -> Option<f64>) -> Option<[f64; 2]> {
    let values = rows.iter().filter(|row| row.technique == technique && row.back_end == back_end).filter_map(of);
    values.fold(None, |range: Option<[f64; 2]>, v| Some(range.map_or([v, v], |[low, high]| [low.min(v), high.max(v)])))
}

fn geometric_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for v in values {
        sum += v.ln();
        count += 1;
    }
    (sum / f64::from(count)).exp()
}
