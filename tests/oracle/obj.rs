//! Meshes as OBJ text.

use std::fmt::Write;

use super::vector::V3;

/// Vertices and polygons, and the text of a file with them.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    pub vertices: Vec<V3>,
    pub polygons: Vec<Vec<usize>>,
}

impl Shape {
    /// Adds a vertex and returns its number from 0.
    pub fn vertex(&mut self, p: V3) -> usize {
        self.vertices.push(p);
        self.vertices.len() - 1
    }

    /// A net of quads: `at(i, j)` for `0..=n` each.
    pub fn net(n: [usize; 2], at: impl Fn(usize, usize) -> V3) -> Self {
        let mut shape = Self::default();
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                shape.vertex(at(i, j));
            }
        }
        for j in 0..n[1] {
            for i in 0..n[0] {
                let v = j * (n[0] + 1) + i;
                shape.polygons.push(vec![v, v + 1, v + n[0] + 2, v + n[0] + 1]);
            }
        }
        shape
    }

    /// Every polygon cut into a fan.
    pub fn triangulated(&self) -> Self {
        let fan = |p: &Vec<usize>| (1..p.len() - 1).map(|k| vec![p[0], p[k], p[k + 1]]).collect::<Vec<_>>();
        Self { vertices: self.vertices.clone(), polygons: self.polygons.iter().flat_map(fan).collect() }
    }

    /// Every vertex moved.
    pub fn map(mut self, at: impl Fn(V3) -> V3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v = at(*v));
        self
    }

    /// As a file. Rust writes the shortest text that reads back as the same f64.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for v in &self.vertices {
            let _ = writeln!(text, "v {} {} {}", v[0], v[1], v[2]);
        }
        for p in &self.polygons {
            let numbers: Vec<String> = p.iter().map(|v| (v + 1).to_string()).collect();
            let _ = writeln!(text, "f {}", numbers.join(" "));
        }
        text
    }
}
