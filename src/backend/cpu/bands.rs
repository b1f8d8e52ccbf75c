//! Bands of rows: which triangles and edges each one sees, and how one is drawn from start to finish.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::clip::clip_triangle;
use super::isa::dispatch;
use super::resolve::resolve;
use super::transform::{ScreenVertex, homogeneous};
use super::visibility::{self, NOTHING, SampleBand, Setup, area, axis_bounds, is_wanted};
use super::{CHUNK, Stages, lines, shade};
use crate::limits::{Deadline, Stopped};
use crate::plan::{DrawPlan, Faces};

/// Sample memory of a band, bytes: half of a common 1 MiB second-level cache.
const BAND_BYTES: usize = 512 << 10;

/// Rows in each band but the last.
pub fn rows_per_band(plan: &DrawPlan<'_>) -> u32 {
    let row_bytes = plan.width_px as usize * plan.samples as usize * 8;
    ((BAND_BYTES / row_bytes.max(1)) as u32).clamp(1, plan.height_px.max(1))
}

/// What each band has to draw, chunk by chunk in ascending order.
pub struct Bins {
    triangles: Vec<ChunkBins>,
    edges: Vec<Vec<Vec<u32>>>,
}

/// A chunk's triangles by band.
struct ChunkBins {
    /// Ids.
    whole: Vec<Vec<u32>>,
    /// Pieces of triangles that had to be clipped.
    pieces: Vec<Vec<(u32, [ScreenVertex; 3])>>,
}

/// Sorts the plan's triangles and edges into bands.
pub fn bin(
    stages: &Stages<'_>,
    pool: Option<&rayon::ThreadPool>,
    rows: u32,
    deadline: &Deadline,
) -> Result<Bins, Stopped> {
    let plan = stages.plan;
    let count = plan.triangles.len();
    let surface = plan.surface.as_ref().map(|s| (0..count, s.faces));
    let hull = plan.hull.as_ref().map(|_| (count..2 * count, Faces::Back));
    let chunks: Vec<_> = [surface, hull]
        .into_iter()
        .flatten()
        .flat_map(|(ids, faces)| {
            let end = ids.end;
            ids.step_by(CHUNK).map(move |first| (first..end.min(first + CHUNK), faces))
        })
        .collect();
    let triangles = map(pool, chunks, |(ids, faces)| match deadline.check() {
        Ok(()) => bin_triangles(stages, rows, ids, faces),
        Err(Stopped) => ChunkBins { whole: Vec::new(), pieces: Vec::new() },
    });
    let edge_count = plan.lines.as_ref().map_or(0, |lines| lines.edges.len());
    let edge_chunks = (0..edge_count).step_by(CHUNK).map(|first| first..edge_count.min(first + CHUNK)).collect();
    let edges = map(pool, edge_chunks, |range| match deadline.check() {
        Ok(()) => bin_edges(stages, rows, range),
        Err(Stopped) => Vec::new(),
    });
    deadline.check()?;
    Ok(Bins { triangles, edges })
}

fn band_count(plan: &DrawPlan<'_>, rows: u32) -> usize {
    plan.height_px.div_ceil(rows) as usize
}

fn bin_triangles(stages: &Stages<'_>, rows: u32, ids: std::ops::Range<usize>, faces: Faces) -> ChunkBins {
    let plan = stages.plan;
    let bands = band_count(plan, rows);
    let mut bins = ChunkBins { whole: vec![Vec::new(); bands], pieces: vec![Vec::new(); bands] };
    for id in ids {
        let vertices = stages.screen_triangle(id as u32);
        if vertices.iter().any(ScreenVertex::is_outside) {
            bin_clipped(stages, rows, id as u32, faces, &mut bins);
        } else if is_wanted(faces, area(&vertices))
            && let Some([first, last]) = bands_of(plan, rows, &vertices)
        {
            for band in first..=last {
                bins.whole[band].push(id as u32);
            }
        }
    }
    bins
}

fn bin_clipped(stages: &Stages<'_>, rows: u32, id: u32, faces: Faces, bins: &mut ChunkBins) {
    let plan = stages.plan;
    if !plan.projection.clip {
        return;
    }
    let corners = stages.positions_of(id).map(|(position, _)| homogeneous(&plan.projection, position));
    clip_triangle(&plan.projection, corners, |piece| {
        if is_wanted(faces, area(&piece))
            && let Some([first, last]) = bands_of(plan, rows, &piece)
        {
            for band in first..=last {
                bins.pieces[band].push((id, piece));
            }
        }
    });
}

/// First and last band that a triangle on screen touches; None if it lies beside, above or below the picture.
#[inline(always)]
fn bands_of(plan: &DrawPlan<'_>, rows: u32, v: &[ScreenVertex; 3]) -> Option<[usize; 2]> {
    axis_bounds(&v.map(|v| v.x), plan.width_px, 0, plan.width_px)?;
    let [first, last] = axis_bounds(&v.map(|v| v.y), plan.height_px, 0, plan.height_px)?;
    Some([first as usize / rows as usize, last as usize / rows as usize])
}

fn bin_edges(stages: &Stages<'_>, rows: u32, range: std::ops::Range<usize>) -> Vec<Vec<u32>> {
    let mut bins = vec![Vec::new(); band_count(stages.plan, rows)];
    let Some(pass) = &stages.plan.lines else { return bins };
    for i in range {
        let edge = &pass.edges[i];
        if lines::is_back_edge(stages, pass, edge) {
            continue;
        }
        if let Some(segment) = lines::Segment::new(stages, pass, edge) {
            let [first, last] = segment.rows(stages.plan.height_px);
            for band in first / rows as i32..=last / rows as i32 {
                if first <= last {
                    bins[band as usize].push(i as u32);
                }
            }
        }
    }
    bins
}

/// A band's buffers, kept from band to band.
pub struct BandScratch {
    samples: SampleBand,
    /// Rows that `samples` has room for; the last band of a picture may use fewer.
    rows: u32,
    colors: Vec<[f32; 4]>,
    ink: Vec<u32>,
}

/// Buffers of bands that nobody draws just now.
#[derive(Default)]
pub struct ScratchPool(Mutex<Vec<BandScratch>>);

impl ScratchPool {
    /// Lends a scratch that fits the plan.
    pub fn with(&self, plan: &DrawPlan<'_>, rows: u32, each: impl FnOnce(&mut BandScratch)) {
        let size_px = [plan.width_px, plan.height_px];
        let fits =
            |s: &BandScratch| s.samples.size_px == size_px && s.rows == rows && s.samples.samples == plan.samples;
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().filter(fits);
        let mut scratch = kept.unwrap_or_else(|| BandScratch {
            samples: SampleBand::new(size_px, 0, rows, plan.samples),
            rows,
            colors: Vec::new(),
            ink: Vec::new(),
        });
        each(&mut scratch);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }
}

/// Draws band number `band` into its rows of the picture.
pub fn draw(stages: &Stages<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize, rgba: &mut [u8]) {
    let (plan, isa) = (stages.plan, stages.isa);
    let pixels = rgba.len() / 4;
    fill_samples(stages, scratch, bins, band);
    scratch.colors.clear();
    scratch.colors.resize(pixels, [0.0; 4]);
    if plan.surface.is_some() || plan.hull.is_some() {
        shade_band(isa, stages, &scratch.samples, &mut scratch.colors);
    }
    if plan.lines.is_some() {
        scratch.ink.clear();
        scratch.ink.resize(pixels, 0);
        draw_edges(isa, stages, bins, band, &scratch.samples, &mut scratch.ink);
    }
    let ink = plan.lines.as_ref().map(|_| scratch.ink.as_slice());
    resolve(plan, stages.srgb, &scratch.colors, ink, rgba);
}

/// Draws band number `band` of the visibility buffer alone, as [`Renderer::draw_visibility`](super::Renderer) says.
pub fn draw_visibility(stages: &Stages<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize, words: &mut [u64]) {
    fill_samples(stages, scratch, bins, band);
    let samples = &scratch.samples;
    for (i, word) in words.iter_mut().enumerate() {
        let (pixel, s) = (i as u32 / samples.samples, i as u32 % samples.samples);
        let (x, row) = (pixel % samples.size_px[0], pixel / samples.size_px[0]);
        let at = samples.index(x, samples.first_row + row, s);
        let id = samples.ids[at];
        *word = if id == NOTHING { 0 } else { u64::from(samples.depth[at].to_bits()) << 32 | u64::from(!id) };
    }
}

/// Moves the scratch to the band and fills its samples, unless nothing in the plan reads them.
fn fill_samples(stages: &Stages<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize) {
    let plan = stages.plan;
    let first_row = band as u32 * scratch.rows;
    scratch.samples.first_row = first_row;
    scratch.samples.rows = scratch.rows.min(plan.height_px - first_row);
    if plan.surface.is_some() || plan.hull.is_some() {
        scratch.samples.clear();
        draw_triangles(stages.isa, stages, bins, band, &mut scratch.samples);
    }
}

dispatch! {
    /// The visibility stage of a band.
    pub fn draw_triangles(stages: &Stages<'_>, bins: &Bins, band: usize, samples: &mut SampleBand) = triangles_kernel
}

dispatch! {
    /// The shade stage of a band.
    pub fn shade_band(stages: &Stages<'_>, samples: &SampleBand, colors: &mut [[f32; 4]]) = shade::shade
}

dispatch! {
    /// The line stage of a band.
    pub fn draw_edges(stages: &Stages<'_>, bins: &Bins, band: usize, samples: &SampleBand, ink: &mut [u32]) = edges_kernel
}

#[inline(always)]
fn triangles_kernel(stages: &Stages<'_>, bins: &Bins, band: usize, samples: &mut SampleBand) {
    for chunk in &bins.triangles {
        // Pieces come first and out of order, so that ties must be looked at: only where something was clipped at all.
        for (id, piece) in &chunk.pieces[band] {
            if let Some(setup) = Setup::new(piece) {
                visibility::draw::<true>(&setup, *id, samples);
            }
        }
        for &id in &chunk.whole[band] {
            if let Some(setup) = Setup::new(&stages.screen_triangle(id)) {
                if stages.plan.projection.clip {
                    visibility::draw::<true>(&setup, id, samples);
                } else {
                    visibility::draw::<false>(&setup, id, samples);
                }
            }
        }
    }
}

#[inline(always)]
fn edges_kernel(stages: &Stages<'_>, bins: &Bins, band: usize, samples: &SampleBand, ink: &mut [u32]) {
    let Some(pass) = &stages.plan.lines else { return };
    let mut planes = lines::PlaneCache::new();
    for chunk in &bins.edges {
        for &edge in &chunk[band] {
            lines::draw(stages, pass, &pass.edges[edge as usize], samples, &mut planes, ink);
        }
    }
}

fn map<T: Send, U: Send>(
    pool: Option<&rayon::ThreadPool>,
    items: Vec<T>,
    each: impl Fn(T) -> U + Sync + Send,
) -> Vec<U> {
    match pool {
        Some(pool) => pool.install(|| items.into_par_iter().map(each).collect()),
        None => items.into_iter().map(each).collect(),
    }
}
