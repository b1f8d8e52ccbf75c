//! A scene's triangles on screen, and which of them are near a place.

use super::camera::{Camera, project};
use super::vector::{V2, V3, cross2, sub};

/// A scene in homogeneous coordinates.
#[derive(Clone, Debug)]
pub struct Scene {
    pub camera: Camera,
    pub positions: Vec<V3>,
    /// Counter-clockwise on screen is the front.
    pub triangles: Vec<[u32; 3]>,
    pub sides: Sides,
    /// Pairs of positions, each edge once.
    pub edges: Vec<[u32; 2]>,
}

/// The sides of triangles that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    Both,
    Front,
    Back,
    /// None: no surface at all.
    Neither,
}

/// A triangle on screen, or what of one lies in front of the near plane.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The triangle's index.
    pub triangle: u32,
    /// Its vertices.
    pub vertices: [u32; 3],
    /// Pixels from the upper left corner, and depth; clockwise on screen.
    pub corners: [V3; 3],
}

/// A scene on screen.
pub struct Screen {
    pub camera: Camera,
    pub pieces: Vec<Piece>,
    tiles: Vec<Vec<u32>>,
    counts: [usize; 2],
}

/// Side of a tile, pixels.
const TILE_PX: f64 = 8.0;

impl Screen {
    pub fn new(scene: &Scene) -> Self {
        let counts = scene.camera.size_px.map(|n| n.div_ceil(TILE_PX as u32) as usize);
        let mut screen = Self { camera: scene.camera, pieces: pieces(scene), tiles: Vec::new(), counts };
        screen.tiles = vec![Vec::new(); counts[0] * counts[1]];
        for i in 0..screen.pieces.len() {
            let corners = screen.pieces[i].corners.map(|c| [c[0], c[1]]);
            for tile in screen.tiles_of(&corners) {
                screen.tiles[tile].push(i as u32);
            }
        }
        screen
    }

    /// The pieces that may touch the box around some points, each once.
    pub fn near(&self, points: &[V2]) -> Vec<&Piece> {
        let mut found: Vec<u32> =
            self.tiles_of(points).into_iter().flat_map(|t| self.tiles[t].iter().copied()).collect();
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|i| &self.pieces[i as usize]).collect()
    }

    /// Tiles that touch the box around some points. What lies beside the picture counts to its
    /// border's tiles, so that two things that meet always share a tile.
    fn tiles_of(&self, points: &[V2]) -> Vec<usize> {
        let range = |k: usize| {
            let tile = |v: f64| (v / TILE_PX).floor().clamp(0.0, self.counts[k] as f64 - 1.0) as usize;
            let low = points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max);
            tile(low)..=tile(high)
        };
        let columns = range(0);
        range(1).flat_map(|j| columns.clone().map(move |i| j * self.counts[0] + i)).collect()
    }
}

impl Piece {
    /// Twice the area of the part of the piece that lies opposite corner `k` from `p`; negative
    /// outside of that side.
    pub fn side(&self, k: usize, p: V2) -> f64 {
        let at = |i: usize| [self.corners[i % 3][0], self.corners[i % 3][1]];
        cross2(sub(at(k + 2), at(k + 1)), sub(p, at(k + 1)))
    }

    /// Depth where a point lies inside, by the weights of the corners, which are between 0 and 1
    /// there: that holds for the thinnest of triangles too.
    pub fn depth_inside(&self, p: V2) -> f64 {
        let sides = [0, 1, 2].map(|k| self.side(k, p).max(0.0));
        let total: f64 = sides.iter().sum();
        if total > 0.0 { (0..3).map(|k| sides[k] / total * self.corners[k][2]).sum() } else { self.corners[0][2] }
    }

    /// Depth at a point, if it lies inside.
    pub fn depth(&self, p: V2) -> Option<f64> {
        (0..3).all(|k| self.side(k, p) >= 0.0).then(|| self.depth_inside(p))
    }
}

/// True if a triangle shows its front: by the sign of the volume that its homogeneous corners span
/// with the eye, which is right for corners behind the eye too. None where it is seen edge on.
pub fn is_front(camera: &Camera, corners: [V3; 3]) -> Option<bool> {
    let [a, b, c] = corners.map(|p| camera.homogeneous(p)).map(|h| [h[0], h[1], h[3]]);
    let volume = super::vector::dot(a, super::vector::cross(b, c));
    (volume != 0.0).then_some(volume < 0.0)
}

fn pieces(scene: &Scene) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (triangle, &vertices) in scene.triangles.iter().enumerate() {
        let corners = vertices.map(|v| scene.positions[v as usize]);
        let Some(front) = is_front(&scene.camera, corners) else { continue };
        let is_there = match scene.sides {
            Sides::Both => true,
            Sides::Front => front,
            Sides::Back => !front,
            Sides::Neither => false,
        };
        if !is_there {
            continue;
        }
        let polygon: Vec<V3> =
            scene.camera.in_front(&corners.map(|p| scene.camera.homogeneous(p))).into_iter().map(project).collect();
        for k in 2..polygon.len() {
            let fan = if front { [0, k, k - 1] } else { [0, k - 1, k] };
            pieces.push(Piece { triangle: triangle as u32, vertices, corners: fan.map(|i| polygon[i]) });
        }
    }
    pieces
}
