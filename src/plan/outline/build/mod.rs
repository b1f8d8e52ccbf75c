//! Outlines around surfaces: beside each rim a strip, and around the corners between two of them a fan.
//!
//! What is drawn is all that lies within the outline's thickness of where the surface ends on screen, on the side where nothing of it is.
//! Corners are round: a corner's outline is an arc around it, so short that it does not matter how sharp the corner is. Where a corner
//! turns inwards the strips lie over each other.

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::plan::PlanError;
use crate::plan::build::{LAYERED_BYTES, LISTED_BYTES, VERTEX_BYTES, thickness};
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::edges::Edges;
use crate::plan::outline::round_join::{End, Fans};
use crate::plan::outline::silhouette_edges::{Rim, View, row_dot};
use crate::plan::{Edge, HullPass, HullVertex, Projection, Thickness};
use crate::scene::material_groups::MaterialGroups;
use crate::spec::OutlineMethod;

/// 1/256 px in a pixel.
const PX: f64 = 256.0;

/// The widest outline, pixels: so that one around something beside the picture still lies in the guard band.
const THICKNESS_MAX_PX: f64 = 1000.0;

/// How fast an outline recedes from the edge that it runs along, as it gets away from it: a length in the depth for each across. What
/// is next to the edge on the same surface hides it, and what is farther behind does not.
const RECEDES: f64 = 0.5;

/// How fast at most where it follows a face beyond its edge, to lie behind what continues that face elsewhere: the other teeth of a gear.
const RECEDES_MAX: f64 = 2.5;

/// How much faster than the face.
const RECEDES_MORE: f64 = 0.05;

/// The least depth of what is still before the far plane.
const DEPTH_MIN: f64 = 1e-30;

/// A point on screen: x and y in 1/256 px, reversed depth, 1 / W. All of these change evenly along an edge and across a face.
type Spot = [f64; 4];

/// Draws the strips and the fans.
pub struct Outlines<'a> {
    view: &'a View<'a>,
    thicknesses: &'a [Option<Thickness>],
    /// Half of the picture and of what is beyond it and seen, 1/256 px.
    half: [f64; 2],
    /// 1/256 px a unit of the box at W = 1.
    scale: f64,
    /// How Z and W change towards the viewer.
    nearer: [f64; 2],
    fans: Fans,
    hull: HullPass<'static>,
}

impl<'a> Outlines<'a> {
    /// Around the rims of a view.
    pub fn draw(
        view: &'a View<'a>,
        thicknesses: &'a [Option<Thickness>],
        (size_px, margin_px): ([u32; 2], u32),
        rims: &[Rim],
        cx: &mut PlanContext<'_>,
    ) -> Result<HullPass<'static>, PlanError> {
        let p = view.projection;
        let along = |row: &[f32; 4]| (0..3).map(|k| f64::from(row[k]) * f64::from(p.to_viewer[k])).sum::<f64>();
        let scale = (0..3).map(|k| f64::from(p.x[k]) * f64::from(p.x[k])).sum::<f64>().sqrt();
        let half = size_px.map(|size| 0.5 * PX * f64::from(size + 2 * margin_px));
        // Strips of at most four corners, and two triangles with a material; and what fans are told of both ends.
        let bytes = 4 * size_of::<HullVertex>() + 2 * (size_of::<[u32; 3]>() + 4) + 2 * size_of::<End>();
        cx.budget.spend("an outline's strips", rims.len() as u64, bytes as u64)?;
        let hull = HullPass {
            vertices: Vec::with_capacity(4 * rims.len()),
            triangles: Vec::with_capacity(2 * rims.len()),
            triangle_materials: Vec::with_capacity(2 * rims.len()),
            ..HullPass::default()
        };
        let fans = Fans::with_capacity(2 * rims.len(), size_px);
        let nearer = [along(&p.z), along(&p.w)];
        let mut outlines = Self { view, thicknesses, half, scale, nearer, fans, hull };
        for (i, rim) in rims.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                cx.deadline.check()?;
            }
            outlines.strip(rim);
        }
        outlines.fans.finish(view, &mut outlines.hull, cx)?;
        Ok(outlines.hull)
    }

    /// The strip beside a rim.
    fn strip(&mut self, rim: &Rim) {
        let Some((ends, are_whole)) = self.on_screen(rim) else { return };
        let [a, b] = ends;
        let way = [b[0] - a[0], b[1] - a[1]];
        let length = (way[0] * way[0] + way[1] * way[1]).sqrt();
        let reach = ends.map(|end| self.reach(rim.material, end[3]));
        if length < 1e-6 || reach[0].max(reach[1]) <= 0.0 {
            return;
        }
        let along = way.map(|v| v / length);
        let out = f64::from(rim.free);
        // Tangent to the circles around both ends, of which one may be nearer and larger. Where it surrounds the other the strip is empty,
        // and the nearer end's fan reaches around to it.
        let sine = ((reach[0] - reach[1]) / length).clamp(-1.0, 1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        let normal = [sine * along[0] - cosine * out * along[1], sine * along[1] + cosine * out * along[0]];
        let depths = self.depths(rim, ends, [along[0], along[1], length], normal, reach);
        let outer = [0, 1].map(|k| {
            let at = [0, 1].map(|axis| ends[k][axis] + reach[k] * normal[axis]);
            self.vertex([at[0], at[1], depths[k], ends[k][3]])
        });
        let inner = [0, 1].map(|k| if are_whole[k] { rim.vertices[k] } else { self.vertex(ends[k]) });
        self.hull.triangles.extend([[inner[0], inner[1], outer[1]], [inner[0], outer[1], outer[0]]]);
        self.hull.triangle_materials.extend([rim.material; 2]);
        for k in (0..2).filter(|&k| are_whole[k]) {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            self.fans.push(End {
                vertex: rim.vertices[k],
                outer: outer[k],
                material: rim.material,
                free: if k == 0 { rim.free } else { -rim.free },
                angle: libm::atan2(sign * along[1], sign * along[0]),
                turn: libm::acos(sign * sine),
                middle: [ends[k][0], ends[k][1]],
                reach: reach[k],
                depth: depths[k],
                inv_w: ends[k][3],
                slope: sign * (b[2] - a[2]) / length,
                is_hidden: false,
            });
        }
    }

    /// A new vertex of the hull.
    fn vertex(&mut self, spot: Spot) -> u32 {
        self.hull.vertices.push(snapped(spot));
        (self.view.mesh.positions.len() + self.hull.vertices.len() - 1) as u32
    }

    /// How far an outline reaches, in 1/256 px.
    fn reach(&self, material: u32, inv_w: f64) -> f64 {
        let reach = match self.thicknesses.get(material as usize) {
            Some(Some(Thickness::Px(px))) => PX * f64::from(*px),
            Some(Some(Thickness::Object(units))) => f64::from(*units) * self.scale * inv_w,
            _ => 0.0,
        };
        reach.min(PX * THICKNESS_MAX_PX)
    }

    /// The part of a rim before the near plane whose outline may be in the picture, and which of its ends are the edge's own.
    fn on_screen(&self, rim: &Rim) -> Option<([Spot; 2], [bool; 2])> {
        let near = f64::from(self.view.projection.near_w) * (1.0 + 1e-5);
        let [a, b] = rim.vertices.map(|v| self.homogeneous(v));
        let mut are_whole = [true; 2];
        let mut ends = [a, b];
        for k in 0..2 {
            if ends[k][3] < near {
                let (inside, outside) = (ends[1 - k], ends[k]);
                if inside[3] < near {
                    return None;
                }
                let t = (inside[3] - near) / (inside[3] - outside[3]);
                ends[k] = mix(&inside, &outside, t);
                are_whole[k] = false;
            }
        }
        let spots = ends.map(|[x, y, z, w]| [x / w, y / w, z / w, 1.0 / w]);
        let margin = spots.map(|spot| self.reach(rim.material, spot[3])).into_iter().fold(0.0, f64::max) + 2.0 * PX;
        let mut range = [0.0, 1.0];
        let (from, to) = (spots[0], spots[1]);
        for (axis, half) in self.half.into_iter().enumerate() {
            let limit = half + margin;
            narrow(&mut range, limit - from[axis], limit - to[axis])?;
            narrow(&mut range, limit + from[axis], limit + to[axis])?;
        }
        let cut = [range[0] > 0.0, range[1] < 1.0];
        let clipped = [0, 1].map(|k| if cut[k] { mix(&spots[0], &spots[1], range[k]) } else { spots[k] });
        Some((clipped, [0, 1].map(|k| are_whole[k] && !cut[k])))
    }

    /// X, Y, Z, W.
    fn homogeneous(&self, vertex: u32) -> [f64; 4] {
        let [x, y, w] = self.view.places[vertex as usize];
        [x, y, row_dot(&self.view.projection.z, self.view.mesh.positions[vertex as usize]), w]
    }

    /// Depths of the outer corners of a strip.
    fn depths(
        &self,
        rim: &Rim,
        ends: [Spot; 2],
        [right, down, length]: [f64; 3],
        normal: [f64; 2],
        reach: [f64; 2],
    ) -> [f64; 2] {
        // How depth changes from the edge on outwards, in the plane of the face that is nearer.
        let slope_along = (ends[1][2] - ends[0][2]) / length;
        let out = f64::from(rim.free);
        let slope = |face: u32| {
            let corners = self.view.mesh.triangles.get(face as usize)?;
            let third = corners.iter().find(|v| !rim.vertices.contains(v))?;
            let [x, y, z, w] = self.homogeneous(*third);
            let from = [x / w - ends[0][0], y / w - ends[0][1]];
            let across = out * (right * from[1] - down * from[0]);
            let is_known = w >= f64::from(self.view.projection.near_w) && across < -1e-6;
            is_known.then(|| (z / w - ends[0][2] - slope_along * (right * from[0] + down * from[1])) / across)
        };
        let slope = rim.faces.iter().filter(|face| **face != Edge::NO_FACE).filter_map(|face| slope(*face));
        let slope = slope.fold(f64::INFINITY, f64::min);
        let sideways = normal[0] * right + normal[1] * down;
        let outwards = out * (right * normal[1] - down * normal[0]);
        [0, 1].map(|k| {
            let [_, _, depth, inv_w] = ends[k];
            let receding = |share: f64| {
                let away = share * reach[k] / (self.scale * inv_w).max(1e-300);
                let (z, w) = (depth / inv_w - away * self.nearer[0], 1.0 / inv_w - away * self.nearer[1]);
                z / w
            };
            let usual = receding(RECEDES);
            let followed = depth + reach[k] * (sideways * slope_along + outwards * slope);
            let depth = if followed < usual && followed > receding(RECEDES_MAX) {
                followed - (depth - receding(RECEDES_MORE))
            } else {
                usual
            };
            depth.max(DEPTH_MIN)
        })
    }
}

/// The hull of the parts that have one.
pub fn hull_pass<'a>(
    mesh: &'a Mesh,
    groups: &MaterialGroups<'_>,
    (projection, size_px, margin_px): (&Projection, [u32; 2], u32),
    edges: &mut Edges<'a>,
    cx: &mut PlanContext<'_>,
) -> Result<HullPass<'a>, PlanError> {
    let outline = |m: usize| groups.layers[m].outline.filter(|o| o.method == OutlineMethod::Hull);
    let thicknesses: Vec<Option<Thickness>> =
        (0..groups.layers.len()).map(|m| outline(m).map(|o| thickness(mesh, &o))).collect();
    let mut colors: Vec<[f32; 4]> =
        (0..groups.layers.len()).map(|m| outline(m).map_or([0.0; 4], |o| o.color.premultiplied())).collect();
    let used: Vec<[f32; 4]> = (0..colors.len()).filter(|&m| thicknesses[m].is_some()).map(|m| colors[m]).collect();
    let color = used.first().copied().unwrap_or_default();
    if used.iter().all(|c| *c == color) {
        colors = vec![color];
    }
    let tells_apart = colors.len() > 1 || (groups.layers_pass().is_some() && mesh.materials.len() > 1);
    let found = edges.with_silhouettes(mesh, groups, cx)?;
    let view = View::new(mesh, groups, projection, cx)?;
    let rims = view.rims(&thicknesses, found, cx)?;
    let surface_materials: &[u32] = if tells_apart { &mesh.triangle_materials } else { &[] };
    let mut hull = Outlines::draw(&view, &thicknesses, (size_px, margin_px), &rims, cx)?;
    pay_drawing(hull.vertices.len() as u64, hull.triangles.len() as u64, groups, cx.budget)?;
    if !tells_apart {
        hull.triangle_materials = Vec::new();
    }
    Ok(HullPass { colors, surface_materials, ..hull })
}

/// Spends what both back-ends will allocate for a hull: as for the mesh's own vertices and triangles.
fn pay_drawing(
    vertices: u64,
    triangles: u64,
    groups: &MaterialGroups<'_>,
    budget: &mut Budget,
) -> Result<(), LimitExceeded> {
    budget.spend("an outline's vertices on screen", vertices, VERTEX_BYTES)?;
    budget.spend("lists of an outline's triangles", triangles, LISTED_BYTES)?;
    let layers = if groups.layers_pass().is_some() { LAYERED_BYTES } else { 0 };
    budget.spend("lists of an outline's layers", triangles, layers)
}

/// The vertex at a spot, which lies in the guard band.
pub fn snapped([x, y, z, inv_w]: Spot) -> HullVertex {
    // As far as a vertex may lie: never reached, but NaN must become a number here.
    let round = |v: f64| libm::rint(v).clamp(-1_048_576.0, 1_048_576.0) as i32;
    HullVertex { x: round(x), y: round(y), z: z as f32, inv_w: inv_w as f32 }
}

fn mix(a: &[f64; 4], b: &[f64; 4], t: f64) -> [f64; 4] {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

/// Cuts a range down to where the even function with these values at 0 and 1 is not negative.
fn narrow(range: &mut [f64; 2], from: f64, to: f64) -> Option<()> {
    if from < 0.0 && to < 0.0 {
        return None;
    }
    if from < 0.0 {
        range[0] = range[0].max(from / (from - to));
    } else if to < 0.0 {
        range[1] = range[1].min(from / (from - to));
    }
    (range[0] < range[1]).then_some(())
}

#[cfg(test)]
mod tests;
