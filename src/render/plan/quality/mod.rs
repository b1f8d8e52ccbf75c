//! Quality targets: a request may say how large the error of a picture, or the time to draw it, may
//! be. The number of samples, the method of drawing wires and the back-end that it leaves open are
//! then selected from a table of measured errors and times.
//!
//! A technique is a way to draw something: surfaces (whose error lies at the edges of their
//! faces), wires along edges, or outlines around shapes. The expected error of a picture is the
//! largest error of the techniques that it uses. It does not cover texture filtering, smooth normals between vertices, or the order and the
//! borders of layers. The expected time is the sum of the times of these techniques on the machine
//! of the table, where the CPU draws with one thread. For other machines it is a hint.

pub(crate) mod error_table;

use std::fmt;

use error_table::ErrorTable;

use crate::spec::words::word_for;
use crate::spec::{
    BackendChoice, FlatNormals, Hidden, Layers, OutlineMethod, QualityTarget, Samples, Shading, Spec, WIRE_METHODS,
    Wire, WireMethod, WireThickness,
};
use crate::warning::Warning;

/// A request in which everything that it left open is filled in.
#[derive(Clone, Debug)]
pub struct SelectedSpec {
    /// The request that is drawn.
    pub spec: Spec,
    /// The selected values, for the response.
    pub selection: QualitySelection,
    /// Targets that are out of reach.
    pub warnings: Vec<Warning>,
}

/// The selected values, and the error and time to expect. Results keep it, so it is small.
#[derive(Clone, Debug)]
pub struct QualitySelection {
    /// The value of `image.samples`.
    pub samples: Samples,
    /// The methods by which wires are drawn, each once.
    pub wire_methods: Vec<&'static str>,
    /// The value of `backend`.
    pub backend: BackendChoice,
    /// Expected error, RMSE in /255.
    pub expected_error: f64,
    /// Expected time of drawing alone, milliseconds.
    pub expected_time_ms: f64,
}

/// Selects what a request leaves open, for a mesh of so many triangles; None where the request has
/// no quality target. `has_gpu` says whether `auto` may mean a GPU here.
pub fn select_quality(spec: &Spec, triangles: usize, has_gpu: bool) -> Option<SelectedSpec> {
    select_from(ErrorTable::shipped(), spec, triangles, has_gpu)
}

impl fmt::Display for QualitySelection {
    /// Writes the selected values in the request's own keys.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "image.samples={}", self.samples)?;
        self.wire_methods.iter().try_for_each(|name| write!(f, ", wire.method={name}"))?;
        write!(f, ", backend={}", word_for(self.backend))
    }
}

fn select_from(table: &ErrorTable, spec: &Spec, triangles: usize, has_gpu: bool) -> Option<SelectedSpec> {
    let target = spec.quality_target.as_ref()?;
    let all = candidates(table, spec, target, triangles, has_gpu);
    let time = |(_, [_, time_ms]): &Candidate| *time_ms;
    let error = |(_, [error, _]): &Candidate| *error;
    let is_in_time = |c: &&Candidate| target.max_time_ms.is_none_or(|max| time(c) <= max);
    let is_exact = |c: &&Candidate| target.max_error.is_none_or(|max| error(c) <= max);
    let cheapest = |a: &&Candidate, b: &&Candidate| time(a).total_cmp(&time(b)).then(error(a).total_cmp(&error(b)));
    let best = |a: &&Candidate, b: &&Candidate| error(a).total_cmp(&error(b)).then(time(a).total_cmp(&time(b)));
    let in_time = || all.iter().filter(is_in_time);
    let wanted = match target.max_error {
        Some(_) => in_time().filter(is_exact).min_by(cheapest),
        None => None,
    };
    let selected = wanted.or_else(|| in_time().min_by(best)).or_else(|| all.iter().min_by(cheapest))?;

    let mut warnings = Vec::new();
    if let Some(max) = target.max_error.filter(|_| !is_exact(&selected)) {
        let detail = format!(
            "an error of at most {max}/255 is asked for, and the best of what may be chosen is expected to have {}/255",
            error(selected)
        );
        warnings.push(Warning { code: "max_error_unmet", detail });
    }
    if let Some(max) = target.max_time_ms.filter(|_| !is_in_time(&selected)) {
        let detail = format!(
            "at most {max} ms are asked for, and the fastest of what may be chosen is expected to take {} ms",
            time(selected)
        );
        warnings.push(Warning { code: "max_time_ms_unmet", detail });
    }
    let (spec, [expected_error, expected_time_ms]) = selected.clone();
    let mut wire_methods: Vec<&str> = wires(&spec).map(|wire| word_for(wire.method)).collect();
    wire_methods.sort_unstable();
    wire_methods.dedup();
    let (samples, backend) = (spec.image.samples, spec.backend);
    let selection = QualitySelection { samples, wire_methods, backend, expected_error, expected_time_ms };
    Some(SelectedSpec { spec, selection, warnings })
}

/// A spec, its expected error and its expected time.
type Candidate = (Spec, [f64; 2]);

/// Every way to fill in what is open, with its expected error and time.
fn candidates(
    table: &ErrorTable,
    spec: &Spec,
    target: &QualityTarget,
    triangles: usize,
    has_gpu: bool,
) -> Vec<Candidate> {
    let adaptive = spec.is_opaque().then_some(Samples::Adaptive);
    let all_samples = || Samples::FIXED.iter().map(|&samples| Samples::Fixed(samples)).chain(adaptive);
    let samples = if target.open.samples { all_samples().collect() } else { vec![spec.image.samples] };
    let has_open_wire = target.open.wire || target.open.material_wires.contains(&true);
    // The width of the other methods depends on each triangle's size.
    let in_pixels = WIRE_METHODS.iter().map(|row| row.method).filter(|method| method.has_pixel_width());
    let methods = if has_open_wire { in_pixels.map(Some).collect() } else { vec![None] };
    let backends = match (target.open.backend, has_gpu && table.knows_gpu()) {
        (false, _) => vec![spec.backend],
        (true, false) => vec![BackendChoice::Cpu],
        (true, true) => vec![BackendChoice::Cpu, BackendChoice::Auto],
    };
    let mut all = Vec::new();
    for &samples in &samples {
        for &method in &methods {
            for &backend in &backends {
                let is_gpu = backend == BackendChoice::Gpu || has_gpu && backend == BackendChoice::Auto;
                let mut spec = spec.clone();
                spec.image.samples = samples;
                spec.backend = backend;
                if method.is_none_or(|method| set_method(&mut spec, target, method)) {
                    let known = expect(table, &spec, if is_gpu { "gpu" } else { "cpu" }, triangles);
                    all.extend(known.map(|expected| (spec, expected)));
                }
            }
        }
    }
    all
}

/// Sets the method of the open wires; false where that would not draw the same lines.
fn set_method(spec: &mut Spec, target: &QualityTarget, method: WireMethod) -> bool {
    let material_wires = spec.materials.iter_mut().map(|(_, layers)| layers).zip(&target.open.material_wires);
    let open = std::iter::once((&mut spec.layers, &target.open.wire)).chain(material_wires);
    for wire in open.filter(|(_, is_open)| **is_open).filter_map(|(layers, _)| layers.wire.as_mut()) {
        match as_wide(wire, method) {
            Some(same) => *wire = same,
            None => return false,
        }
    }
    // All barycentric wires of one picture treat hidden lines alike, and only `hide` was measured.
    method == WireMethod::Exact || wires(spec).all(|w| w.method == WireMethod::Exact || w.hidden == Hidden::Hide)
}

/// An exact wire by another method, with the same width where that method measures pixels rightly:
/// full up to t and gone at t + s on either side of an edge.
fn as_wide(wire: &Wire, method: WireMethod) -> Option<Wire> {
    if method == WireMethod::Exact {
        return Some(*wire);
    }
    let width_px = wire.thickness.largest();
    let smoothing = width_px.min(1.0);
    let thickness = 0.5 * (width_px - smoothing);
    // Within what a request may give itself.
    (smoothing > 0.0 && thickness <= 10.0).then_some(Wire {
        method,
        thickness: WireThickness::Given(thickness),
        smoothing,
        ..*wire
    })
}

/// The error and the time of a picture; None where the table does not have one of its techniques.
fn expect(table: &ErrorTable, spec: &Spec, backend: &str, triangles: usize) -> Option<[f64; 2]> {
    let mut techniques: Vec<&str> = spec.styles().flat_map(techniques).collect();
    techniques.extend(spec.topology.map(|_| word_for(WireMethod::Exact)));
    techniques.sort_unstable();
    techniques.dedup();
    let pixels = f64::from(spec.image.width_px) * f64::from(spec.image.height_px);
    let samples = if spec.is_opaque() { spec.image.samples } else { Samples::Fixed(spec.samples_per_pixel()) };
    let (mut error, mut time_ms) = (0.0_f64, 0.0);
    for technique in techniques {
        let row = table.row(technique, backend, samples)?;
        error = error.max(table.error(row, pixels));
        time_ms += row.time_ms(pixels, triangles as f64);
    }
    // More digits would suggest a precision that the table does not have.
    Some([error, time_ms].map(|v: f64| (v * 1e4).round() / 1e4))
}

fn techniques(layers: &Layers) -> Vec<&'static str> {
    let surface = layers.surface.map(|s| match (s.shading, s.normals) {
        (Shading::Flat, FlatNormals::Derivative) => "derivative",
        _ => "face",
    });
    let wire = layers.wire.map(|wire| word_for(wire.method));
    let outline = layers.outline.map(|outline| match outline.method {
        OutlineMethod::Hull => "hull",
        OutlineMethod::Contour => "contour",
    });
    [surface, wire, outline].into_iter().flatten().collect()
}

fn wires(spec: &Spec) -> impl Iterator<Item = &Wire> {
    spec.styles().filter_map(|layers| layers.wire.as_ref())
}

#[cfg(test)]
mod tests;
