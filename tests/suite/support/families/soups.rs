//! Triangle soups: random triangles of several kinds, to compare back-ends on, and random views of
//! them.

use meshsnap_render::plan::{DrawPlan, Faces, HullPass, Projection, ScreenVertex, ShadedMaterial, SurfacePass};

/// xorshift64*: the tests must draw the same soups everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// From -1 to 1.
    pub fn signed(&mut self) -> f32 {
        ((self.bits() >> 40) as f32 / (1 << 23) as f32) - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn point(&mut self, reach: f32) -> [f32; 3] {
        std::array::from_fn(|_| reach * self.signed())
    }
}

/// The kind of a soup's triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// About a pixel each.
    Tiny,
    /// Much of the picture each.
    Large,
    /// Thin as a hair.
    Sliver,
    /// A bent grid: every edge is shared.
    Grid,
    /// The same triangles again and again, so that depths are equal.
    Ties,
    /// All of these.
    Mixed,
}

pub const KINDS: [Kind; 6] = [Kind::Tiny, Kind::Large, Kind::Sliver, Kind::Grid, Kind::Ties, Kind::Mixed];

pub struct Soup {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Soup {
    pub fn new(kind: Kind, count: usize, reach: f32, random: &mut Random) -> Self {
        let mut soup = Self { positions: vec![], normals: vec![], triangles: vec![] };
        match kind {
            Kind::Grid => soup.grid(count, reach, random),
            _ => (0..count).for_each(|_| soup.triangle(kind, reach, random)),
        }
        soup.normals = soup.positions.iter().map(|_| unit(random.point(1.0))).collect();
        soup
    }

    pub fn triangle(&mut self, kind: Kind, reach: f32, random: &mut Random) {
        let kind = if kind == Kind::Mixed { KINDS[random.below(3)] } else { kind };
        let around = |p: [f32; 3], size: f32, r: &mut Random| {
            let d = r.point(size);
            [p[0] + d[0], p[1] + d[1], p[2] + d[2]]
        };
        let a = random.point(reach);
        let corners = match kind {
            Kind::Tiny => [a, around(a, 0.02, random), around(a, 0.02, random)],
            Kind::Sliver => {
                let b = random.point(reach);
                [a, b, around(b, 0.003, random)]
            }
            Kind::Ties if !self.triangles.is_empty() => {
                let mut again = self.triangles[random.below(self.triangles.len())];
                again.rotate_left(random.below(3));
                self.triangles.push(again);
                return;
            }
            _ => [a, random.point(reach), random.point(reach)],
        };
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    pub fn grid(&mut self, count: usize, reach: f32, random: &mut Random) {
        let n = (count as f32 / 2.0).sqrt().ceil() as u32;
        for y in 0..=n {
            for x in 0..=n {
                let at = |v: u32| reach * (2.0 * v as f32 / n as f32 - 1.0);
                self.positions.push([at(x) + 0.01 * random.signed(), at(y), 0.3 * random.signed()]);
            }
        }
        for y in 0..n {
            for x in 0..n {
                let v = y * (n + 1) + x;
                self.triangles.extend([[v, v + 1, v + n + 1], [v + 1, v + n + 2, v + n + 1]]);
            }
        }
    }

    pub fn plan(&self, view: &View) -> DrawPlan<'_> {
        DrawPlan {
            samples: view.samples,
            surface: view.surface.map(flat_surface),
            hull: view.hull_px.map(|px| self.hull(view, px)),
            background: [1.0; 4],
            ..DrawPlan::new([view.width, view.height], &self.positions, &self.triangles, view.projection)
        }
    }
}

impl Soup {
    /// For each triangle one between its first edge and a corner pushed out, and one of three that
    /// are pushed out.
    fn hull(&self, view: &View, px: f32) -> HullPass<'static> {
        let row = |r: &[f32; 4], p: [f32; 3]| ((r[0] * p[0] + r[1] * p[1]) + r[2] * p[2]) + r[3];
        let projection = &view.projection;
        let pushed = self.positions.iter().zip(&self.normals).map(|(&p, n)| {
            let w = row(&projection.w, p).max(projection.near_w);
            let at = |r, n: f32| (row(r, p) / w + 256.0 * px * n).clamp(-1e6, 1e6).round() as i32;
            let z = row(&projection.z, p) / w * (1.0 + 0.01 * n[2]);
            ScreenVertex { x: at(&projection.x, n[0]), y: at(&projection.y, n[1]), z, inv_w: 1.0 / w }
        });
        let count = self.positions.len() as u32;
        let both = |t: &[u32; 3]| [[t[0], t[1], count + t[2]], t.map(|v| count + v)];
        HullPass {
            colors: vec![[0.0, 0.0, 0.0, 1.0]],
            vertices: pushed.collect(),
            triangles: self.triangles.iter().flat_map(both).collect(),
            ..HullPass::default()
        }
    }
}

pub fn flat_surface(faces: Faces) -> SurfacePass<'static> {
    SurfacePass::new(faces, vec![ShadedMaterial::unlit([0.5, 0.25, 0.125, 1.0])])
}

/// The view of a soup.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub projection: Projection,
    pub surface: Option<Faces>,
    /// The distance of the hull's own corners from the mesh's.
    pub hull_px: Option<f32>,
}

impl View {
    /// From `distance` in front of the origin along a random direction; `distance` 0 is
    /// orthographic.
    pub fn new(size: [u32; 2], samples: u32, distance: f32, random: &mut Random) -> Self {
        let to_viewer = unit(random.point(1.0));
        let right = unit(cross([0.1, 1.0, 0.2], to_viewer));
        let up = cross(to_viewer, right);
        let scale = 128.0 * size[0].min(size[1]) as f32;
        let row = |v: [f32; 3], s: f32, last: f32| [v[0] * s, v[1] * s, v[2] * s, last];
        let perspective = distance > 0.0;
        let scale = if perspective { scale * distance } else { scale };
        let projection = Projection {
            x: row(right, scale, 0.0),
            y: row(up, -scale, 0.0),
            z: if perspective { [0.0, 0.0, 0.0, 0.02] } else { row(to_viewer, 0.25, 0.5) },
            w: if perspective { row(to_viewer, -1.0, distance) } else { [0.0, 0.0, 0.0, 1.0] },
            near_w: 0.02,
            clip: perspective && distance < 2.0,
            to_viewer,
            screen_up: up,
            screen_right: right,
        };
        Self { width: size[0], height: size[1], samples, projection, surface: Some(Faces::Both), hull_px: None }
    }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt().max(1e-6);
    v.map(|c| c / length)
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
