//! The fading of feature edges whose thickness a request leaves open. Their lines are 1 pixel wide. Where they
//! would cover more than 35 % of the picture around a place, as on threads and knurls, they are fainter there.

use std::sync::Arc;

use super::{AutoWidth, COVERED_MAX, View, WIDTHS_PX};
use crate::limits::{Deadline, Stopped};
use crate::plan::Edge;
use crate::plan::context::CHECK_EVERY;
use crate::plan::lines::fade::{Density, LineFade};
use crate::scene::Scene;

impl AutoWidth {
    /// The width of lines along feature edges, pixels.
    pub const FEATURE_PX: f32 = WIDTHS_PX[1] as f32;

    /// The fading of lines of that width along these edges, seen or hidden; None: they are opaque.
    pub fn fade_of_features(
        scene: &Scene<'_, '_>,
        edges: &[Edge],
        deadline: &Deadline,
    ) -> Result<Option<Arc<LineFade>>, Stopped> {
        let view = View::new(scene, true);
        let mut density = Density::new(scene.size_px());
        density.fill();
        for edges in edges.chunks(CHECK_EVERY) {
            deadline.check()?;
            for edge in edges {
                if let [Some(a), Some(b)] = edge.vertices.map(|vertex| view.place_of(vertex)) {
                    density.add_edge([a, b].map(|end| view.in_picture(end)), f64::from(Self::FEATURE_PX));
                }
            }
        }
        Ok(density.fade(COVERED_MAX, 1.0).map(Arc::new))
    }
}
