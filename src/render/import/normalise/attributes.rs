//! The repair of vertex attributes (normals, texture coordinates, colours): values become finite,
//! normals of triangles get unit length, and arrays that cannot be used are dropped, such as one
//! without a value for each vertex.

use crate::import::raw::RawMesh;
use crate::mesh::Mesh;
use crate::parallel::each_piece;
use crate::warning::Warning;

/// The repaired attributes: each empty, or one value per raw vertex.
#[derive(Debug, Default)]
pub struct Attributes {
    /// Unit normals; zero for a vertex that has none in the file and no triangle.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates.
    pub uvs: Vec<[f32; 2]>,
    /// The second set of them.
    pub second_uvs: Vec<[f32; 2]>,
    /// Linear RGBA, 0 to 1.
    pub colors: Vec<[f32; 4]>,
}

/// Takes the attributes of `count` vertices out of `raw` and repairs them. `mesh` has its triangles
/// already.
pub fn repair(raw: &mut RawMesh, count: usize, mesh: &Mesh) -> Attributes {
    let mut colors = std::mem::take(&mut raw.colors);
    each_piece(&mut colors, |piece| {
        for component in piece.iter_mut().flatten() {
            // 1 for a NaN: no tint.
            *component = if component.is_nan() { 1.0 } else { component.clamp(0.0, 1.0) };
        }
    });
    let (mut uvs, mut second_uvs) = (std::mem::take(&mut raw.uvs), std::mem::take(&mut raw.second_uvs));
    let bad_uvs = repair_uvs(&mut uvs) + repair_uvs(&mut second_uvs);
    if bad_uvs > 0 {
        raw.report.warnings.push(Warning {
            code: "uvs_repaired",
            detail: format!("{bad_uvs} texture coordinates are NaN or infinite and were set to 0"),
        });
    }
    let normals = repair_normals(raw, count, mesh);
    let whole = |len: usize| len == count;
    Attributes {
        normals: if whole(normals.len()) { normals } else { Vec::new() },
        uvs: if whole(uvs.len()) { uvs } else { Vec::new() },
        second_uvs: if whole(second_uvs.len()) { second_uvs } else { Vec::new() },
        colors: if whole(colors.len()) { colors } else { Vec::new() },
    }
}

/// Sets coordinates that are not finite to 0. Returns how many there were.
fn repair_uvs(uvs: &mut [[f32; 2]]) -> u64 {
    let bad = each_piece(uvs, |piece| {
        let mut bad = 0_u64;
        for uv in piece.iter_mut().filter(|uv| !(uv[0].is_finite() && uv[1].is_finite())) {
            *uv = [0.0; 2];
            bad += 1;
        }
        bad
    });
    bad.into_iter().sum()
}

/// Unit normals. A normal without a direction becomes the mean of its faces' normals.
fn repair_normals(raw: &mut RawMesh, count: usize, mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut normals = std::mem::take(&mut raw.normals);
    if normals.len() != count {
        return Vec::new();
    }
    let all_good = each_piece(&mut normals, |piece| {
        let mut all_good = true;
        for normal in piece {
            let unit = unit(*normal);
            all_good &= unit.is_some();
            *normal = unit.unwrap_or([0.0; 3]);
        }
        all_good
    });
    if all_good.into_iter().all(|good| good) {
        let is_used = !(mesh.attribute_triangles.is_empty() && mesh.line_point_attributes.is_empty());
        return if is_used { normals } else { Vec::new() };
    }
    let mut is_bad: Vec<bool> = normals.iter().map(|normal| *normal == [0.0; 3]).collect();
    let mut used_bad = 0_u64;
    let mut used_good = 0_u64;
    for (triangle, face) in mesh.attribute_triangles.iter().zip(&mesh.face_normals) {
        for &v in triangle {
            let v = v as usize;
            if is_bad[v] {
                used_bad += 1;
                normals[v] = std::array::from_fn(|k| normals[v][k] + face[k]);
            } else {
                used_good += 1;
            }
        }
    }
    used_good += mesh.line_point_attributes.iter().flatten().filter(|&&v| !is_bad[v as usize]).count() as u64;
    if used_good == 0 {
        return Vec::new();
    }
    if used_bad == 0 {
        return normals;
    }
    raw.report.warnings.push(Warning {
        code: "normals_repaired",
        detail: format!("{used_bad} triangle corners have no usable normal and take that of their faces"),
    });
    for (triangle, face) in mesh.attribute_triangles.iter().zip(&mesh.face_normals) {
        for &v in triangle {
            let v = v as usize;
            if is_bad[v] {
                normals[v] = unit(normals[v]).unwrap_or(*face);
                is_bad[v] = false;
            }
        }
    }
    normals
}

fn unit(n: [f32; 3]) -> Option<[f32; 3]> {
    let n = n.map(f64::from);
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    (length > 0.0 && length.is_finite()).then(|| n.map(|c| (c / length) as f32))
}
