//! An error or a time in place of techniques: the samples, wire method and back-end that a request leaves open are chosen from the
//! measured table.
//!
//! The expected error of a look is the largest of its techniques': of faces' edges, of lines along edges and around shapes. It
//! covers no texture filtering, no smooth normals between vertices and no order of layers. The expected time is the sum of its
//! techniques', on the machine of the table and one thread: a hint for others.

pub(crate) mod error_table;
use std::fmt;

use self::error_table::ErrorTable;
use crate::spec::BackendChoice;
use crate::spec::{FlatNormals, Hidden, Layers, OutlineMethod, QualityTarget, Shading, Spec, Wire, WireMethod};
use crate::warning::Warning;

/// A request with what it left open filled in.
#[derive(Clone, Debug)]
pub struct Selected {
    /// What is drawn.
    pub spec: Spec,
    /// What there is to say about it.
    pub selection: Selection,
    /// Where what was asked for is out of reach.
    pub warnings: Vec<Warning>,
}

/// What was chosen, and what is expected of it. Results keep it, so it is small.
#[derive(Clone, Debug)]
pub struct Selection {
    /// `image.samples`.
    pub samples: u32,
    /// How wires are drawn, each method once.
    pub wire_methods: Vec<&'static str>,
    /// `backend`.
    pub backend: BackendChoice,
    /// RMSE, /255.
    pub expected_error: f64,
    /// Of drawing alone, milliseconds.
    pub expected_time_ms: f64,
}

/// Chooses for a mesh of so many triangles; None where nothing is asked for. `has_gpu`: whether `auto` may mean a GPU here.
pub fn select(spec: &Spec, triangles: usize, has_gpu: bool) -> Option<Selected> {
    select_from(ErrorTable::shipped(), spec, triangles, has_gpu)
}

impl fmt::Display for Selection {
    /// In the request's own keys.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "image.samples={}", self.samples)?;
        self.wire_methods.iter().try_for_each(|name| write!(f, ", wire.method={name}"))?;
        write!(f, ", backend={}", backend_name(self.backend))
    }
}

/// The methods whose width can be given in pixels. The others' depends on each triangle's size.
const METHODS: [WireMethod; 3] = [WireMethod::Exact, WireMethod::Fwidth, WireMethod::FwidthMin];

fn select_from(table: &ErrorTable, spec: &Spec, triangles: usize, has_gpu: bool) -> Option<Selected> {
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
    let chosen = wanted.or_else(|| in_time().min_by(best)).or_else(|| all.iter().min_by(cheapest))?;

    let mut warnings = Vec::new();
    if let Some(max) = target.max_error.filter(|_| !is_exact(&chosen)) {
        let detail = format!(
            "an error of at most {max}/255 is asked for, and the best of what may be chosen is expected to have {}/255",
            error(chosen)
        );
        warnings.push(Warning { code: "max_error_unmet", detail });
    }
    if let Some(max) = target.max_time_ms.filter(|_| !is_in_time(&chosen)) {
        let detail = format!(
            "at most {max} ms are asked for, and the fastest of what may be chosen is expected to take {} ms",
            time(chosen)
        );
        warnings.push(Warning { code: "max_time_ms_unmet", detail });
    }
    let (spec, [expected_error, expected_time_ms]) = chosen.clone();
    let mut wire_methods: Vec<&str> = wires(&spec).map(|wire| method_name(wire.method)).collect();
    wire_methods.sort_unstable();
    wire_methods.dedup();
    let (samples, backend) = (spec.image.samples, spec.backend);
    let selection = Selection { samples, wire_methods, backend, expected_error, expected_time_ms };
    Some(Selected { spec, selection, warnings })
}

/// A spec, its expected error and its expected time.
type Candidate = (Spec, [f64; 2]);

/// Every way to fill in what is open, with what is expected of it.
fn candidates(
    table: &ErrorTable,
    spec: &Spec,
    target: &QualityTarget,
    triangles: usize,
    has_gpu: bool,
) -> Vec<Candidate> {
    let samples = if target.open.samples { vec![1, 4, 8, 16] } else { vec![spec.image.samples] };
    let has_open_wire = target.open.wire || target.open.material_wires.contains(&true);
    let methods = if has_open_wire { METHODS.map(Some).to_vec() } else { vec![None] };
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

/// Draws the open wires so; false where that would not be the same lines.
fn set_method(spec: &mut Spec, target: &QualityTarget, method: WireMethod) -> bool {
    let material_wires = spec.materials.iter_mut().map(|(_, layers)| layers).zip(&target.open.material_wires);
    let open = std::iter::once((&mut spec.layers, &target.open.wire)).chain(material_wires);
    for wire in open.filter(|(_, is_open)| **is_open).filter_map(|(layers, _)| layers.wire.as_mut()) {
        match as_wide(wire, method) {
            Some(same) => *wire = same,
            None => return false,
        }
    }
    // All wires by barycentrics of one picture do the same with hidden ones, and only `hide` was measured.
    method == WireMethod::Exact || wires(spec).all(|w| w.method == WireMethod::Exact || w.hidden == Hidden::Hide)
}

/// An exact wire by another method, as wide where that method's own measure is right: full up to t and gone at t + s on either
/// side of an edge.
fn as_wide(wire: &Wire, method: WireMethod) -> Option<Wire> {
    if method == WireMethod::Exact {
        return Some(*wire);
    }
    let smoothing = wire.thickness.min(1.0);
    let thickness = 0.5 * (wire.thickness - smoothing);
    // What a request may say itself.
    (smoothing > 0.0 && thickness <= 10.0).then_some(Wire { method, thickness, smoothing, ..*wire })
}

/// The error and the time of a look; None where the table does not know one of its techniques.
fn expect(table: &ErrorTable, spec: &Spec, backend: &str, triangles: usize) -> Option<[f64; 2]> {
    let mut techniques: Vec<&str> = looks(spec).flat_map(techniques).collect();
    techniques.extend(spec.topology.map(|_| method_name(WireMethod::Exact)));
    techniques.sort_unstable();
    techniques.dedup();
    let pixels = f64::from(spec.image.width_px) * f64::from(spec.image.height_px);
    let (mut error, mut time_ms) = (0.0_f64, 0.0);
    for technique in techniques {
        let row = table.row(technique, backend, spec.image.samples)?;
        error = error.max(table.error(row, pixels));
        time_ms += row.time_ms(pixels, triangles as f64);
    }
    // More digits would only pretend.
    Some([error, time_ms].map(|v: f64| (v * 1e4).round() / 1e4))
}

fn techniques(layers: &Layers) -> Vec<&'static str> {
    let surface = layers.surface.map(|s| match (s.shading, s.normals) {
        (Shading::Flat, FlatNormals::Derivative) => "derivative",
        _ => "face",
    });
    let wire = layers.wire.map(|wire| method_name(wire.method));
    let outline = layers.outline.map(|outline| match outline.method {
        OutlineMethod::Hull => "hull",
        OutlineMethod::Contour => "contour",
    });
    [surface, wire, outline].into_iter().flatten().collect()
}

fn looks(spec: &Spec) -> impl Iterator<Item = &Layers> {
    std::iter::once(&spec.layers).chain(spec.materials.iter().map(|(_, layers)| layers))
}

fn wires(spec: &Spec) -> impl Iterator<Item = &Wire> {
    looks(spec).filter_map(|layers| layers.wire.as_ref())
}

fn method_name(method: WireMethod) -> &'static str {
    match method {
        WireMethod::Exact => "exact",
        WireMethod::Fwidth => "fwidth",
        WireMethod::FwidthMin => "fwidth-min",
        WireMethod::Barycentric => "barycentric",
        WireMethod::Threshold => "threshold",
    }
}

fn backend_name(backend: BackendChoice) -> &'static str {
    match backend {
        BackendChoice::Auto => "auto",
        BackendChoice::Gpu => "gpu",
        BackendChoice::Cpu => "cpu",
    }
}

#[cfg(test)]
mod tests;
