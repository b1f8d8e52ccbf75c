//! What a request asks for in place of techniques: an error, a time, or both.

/// How good and how soon; at least one of the two is given. What is left open is chosen where spec becomes plan.
#[derive(Clone, Debug, PartialEq)]
pub struct QualityTarget {
    /// Largest expected error: root mean square of the pixels that are drawn, /255. Above 0, at most 255.
    pub max_error: Option<f64>,
    /// Longest expected time to draw, milliseconds. Above 0.
    pub max_time_ms: Option<f64>,
    /// What may be chosen.
    pub open: Open,
}

/// What a request leaves open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Open {
    /// `image.samples`.
    pub samples: bool,
    /// `backend`; not where the server has one that is not `auto`.
    pub backend: bool,
    /// How the document's own wires are drawn: neither `wire.method` is given nor `wire.smoothing`, whose meaning depends on it.
    pub wire: bool,
    /// The same for each of the spec's materials, in their order.
    pub material_wires: Vec<bool>,
}
