//! The section of a report on UV charts, the pieces into which a texture unfolds a surface: how much of the texture
//! they use, how much they stretch it, and how much their faces overlap.

use serde::Serialize;

use super::without_rounding;
use crate::geometry::charts::{self, Chart, Charts, Stretch};
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::pluralise::pluralise;

/// Most charts that are listed: the largest in the texture.
const LISTED_MAX: usize = 50;

/// The charts. Areas are parts of the texture, whose own area is 1; coordinates beyond it count as they are.
#[derive(Clone, Debug, Serialize)]
pub struct ChartsReport {
    /// Sets of faces that are connected by edges in the texture, too.
    charts: u64,
    /// Faces that have no area in the texture. They are in no chart, and have no stretch.
    faces_without_area: u64,
    /// Faces that show the texture's mirror image.
    flipped_faces: u64,
    /// The sum of all areas.
    area: f64,
    /// Null where so many faces lie above each other that looking at all would take long.
    overlaps: Option<OverlapsReport>,
    /// Null without charts.
    stretch: Option<StretchReport>,
    /// The largest charts by area.
    largest: Vec<ChartReport>,
}

/// Faces that lie on others.
#[derive(Clone, Debug, Serialize)]
struct OverlapsReport {
    /// Faces whose interiors have a point in common with another's.
    faces: u64,
    /// The area that faces cover, each point once.
    covered_area: f64,
    /// The area that two faces or more cover.
    overlapping_area: f64,
    /// The most by which rounding has changed these two.
    stated_error: f64,
}

/// Lengths on the surface over lengths in the texture, 1 where they are the same everywhere.
#[derive(Clone, Copy, Debug, Serialize)]
struct StretchReport {
    /// The root mean square over the surface and all directions.
    l2: f64,
    /// The largest.
    linf: f64,
}

/// A chart.
#[derive(Clone, Debug, Serialize)]
struct ChartReport {
    faces: u64,
    flipped_faces: u64,
    area: f64,
    stretch: Option<StretchReport>,
}

impl ChartsReport {
    /// On a mesh.
    pub fn of(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Self, MeshError> {
        let Charts { mut all, faces_without_area } = Charts::of(mesh, budget, deadline)?;
        let overlaps = charts::overlaps(mesh, budget, deadline)?;
        let charts = all.len() as u64;
        let whole = Charts { all: all.clone(), faces_without_area }.whole();
        // Sorting keeps the order of equal ones, which is that of their first faces.
        all.sort_by(|a, b| b.texture_area.total_cmp(&a.texture_area));
        all.truncate(LISTED_MAX);
        let of_chart = |chart: &Chart| ChartReport {
            faces: chart.faces,
            flipped_faces: chart.flipped,
            area: rounded(chart.texture_area),
            stretch: stretch(chart),
        };
        Ok(Self {
            charts,
            faces_without_area,
            flipped_faces: whole.flipped,
            area: rounded(whole.texture_area),
            overlaps: overlaps.map(|found| OverlapsReport {
                faces: found.faces,
                covered_area: rounded(found.covered),
                overlapping_area: rounded(found.overlapping),
                // Rounded up, and with the digits that the areas do not show.
                stated_error: rounded(1.01 * found.error + 1e-6 * found.covered),
            }),
            stretch: stretch(&whole),
            largest: all.iter().map(of_chart).collect(),
        })
    }

    /// For a person to read.
    pub fn text(&self) -> String {
        let Self { charts, faces_without_area, flipped_faces, area, overlaps, stretch, largest } = self;
        if *charts == 0 && *faces_without_area == 0 {
            return "charts       none: it has no texture coordinates\n".to_owned();
        }
        let mut said = vec![charts.to_string()];
        said.push(format!("{} of the texture's area", share(*area)));
        said.extend(stretch.map(|stretch| stretch.text()));
        let counts = [
            (*flipped_faces, "face mirrored", "faces mirrored"),
            (*faces_without_area, "face without area there", "faces without area there"),
        ];
        let met = counts.into_iter().filter(|(count, ..)| *count > 0);
        said.extend(met.map(|(count, one, more)| pluralise(count, one, more)));
        let mut text = format!("charts       {}\n", said.join(", "));
        text += &match overlaps {
            None => "  overlaps   so many faces lie above each other that they were not counted\n".to_owned(),
            Some(OverlapsReport { faces: 0, .. }) => String::new(),
            Some(found) => format!(
                "  overlaps   {}, {} of the texture's area (within {:.0e})\n",
                pluralise(found.faces, "face", "faces"),
                share(found.overlapping_area),
                found.stated_error
            ),
        };
        for chart in largest {
            text += &format!("  {}: {}", pluralise(chart.faces, "face", "faces"), share(chart.area));
            text += &chart.stretch.map(|stretch| format!(", {}", stretch.text())).unwrap_or_default();
            text += "\n";
        }
        if *charts > largest.len() as u64 {
            text += &format!("  and {} more\n", charts - largest.len() as u64);
        }
        text
    }
}

impl StretchReport {
    fn text(self) -> String {
        format!("stretch {:.3} (L2), {:.3} (Linf)", self.l2, self.linf)
    }
}

fn stretch(chart: &Chart) -> Option<StretchReport> {
    let Stretch { l2, linf } = chart.stretch()?;
    Some(StretchReport { l2: rounded(l2), linf: rounded(linf) })
}

/// Seven digits: texture coordinates have no more.
fn rounded(value: f64) -> f64 {
    without_rounding(value, value)
}

fn share(area: f64) -> String {
    match area * 100.0 {
        percent if percent != 0.0 && percent < 0.1 => format!("{percent:.0e} %"),
        percent => format!("{percent:.1} %"),
    }
}
