//! The quality target of a request: a largest error, a longest time, or both. The plan then chooses
//! what the request leaves open of the number of samples, the method of wires and the back-end, so as
//! to reach it.

/// The largest error, the longest time, or both. The plan chooses what the request leaves open, so
/// as to reach them.
#[derive(Clone, Debug, PartialEq)]
pub struct QualityTarget {
    /// Largest expected error: root mean square over the pixels that are drawn, /255. Above 0, at
    /// most 255.
    pub max_error: Option<f64>,
    /// Longest expected time to draw, milliseconds. Above 0.
    pub max_time_ms: Option<f64>,
    /// The keys whose values may be chosen.
    pub open: Open,
}

/// Keys that a request does not give, so that their values may be chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Open {
    /// `image.samples`.
    pub samples: bool,
    /// `backend`. Never open where the server has a default other than `auto`.
    pub backend: bool,
    /// `wire.method` of the document's own layers. Not open if `wire.smoothing` is given, because
    /// its meaning depends on the method.
    pub wire: bool,
    /// The same for each of the spec's materials, in their order.
    pub material_wires: Vec<bool>,
}
