//! Repairs vertex attributes: values become finite, normals become unit, and unusable arrays are
//! dropped.

use crate::import::raw::RawMesh;
use crate::mesh::Mesh;
use crate::warning::Warning;

/// The repaired attributes: each empty, or one value per raw vertex.
#[derive(Debug, Default)]
pub struct Attributes {
    /// Unit normals.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates.
    pub uvs: Vec<[f32; 2]>,
    /// Linear RGBA, 0 to 1.
    pub colors: Vec<[f32; 4]>,
}

/// Takes the attributes of `count` vertices out of `raw` and repairs them. `mesh` has its triangles
/// already.
pub fn repair(raw: &mut RawMesh, count: usize, mesh: &Mesh) -> Attributes {
    let mut colors = std::mem::take(&mut raw.colors);
    for component in colors.iter_mut().flatten() {
        // 1 for a NaN: no tint.
        *component = if component.is_nan() { 1.0 } else { component.clamp(0.0, 1.0) };
    }
    let mut uvs = std::mem::take(&mut raw.uvs);
    let mut bad_uvs = 0_u64;
    for uv in &mut uvs {
        if !(uv[0].is_finite() && uv[1].is_finite()) {
            *uv = [0.0; 2];
            bad_uvs += 1;
        }
    }
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
        colors: if whole(colors.len()) { colors } else { Vec::new() },
    }
}

/// Unit normals. A normal without a direction becomes the mean of its faces' normals.
fn repair_normals(raw: &mut RawMesh, count: usize, mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut normals = std::mem::take(&mut raw.normals);
    if normals.len() != count {
        return Vec::new();
    }
    let mut is_bad = vec![false; normals.len()];
    for (normal, bad) in normals.iter_mut().zip(&mut is_bad) {
        match unit(*normal) {
            Some(n) => *normal = n,
            None => (*normal, *bad) = ([0.0; 3], true),
        }
    }
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
