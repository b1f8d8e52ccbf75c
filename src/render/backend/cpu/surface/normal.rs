//! Normals of shaded points, for light and for opacity that depends on the angle of view: those of faces or vertices,
//! those computed from positions in neighbouring pixels, and those changed by normal textures (stage shade). They are
//! computed for `N` points side by side. Twin of `shaders/surface/normal.wgsl`.

use super::barycentric::Quad;
use super::texture::{blend, of_corners, uv_corners};
use super::wire::ShadedPoints;
use crate::backend::cpu::vector::{across, cross, dot, facing, turned_to_viewer, unit_or, zip};
use crate::plan::{CornerValues, Projection, ShadedMaterial, SurfacePass, flags, slots};

/// The unit normals on the viewer's side, without normal textures, at points of one material.
#[inline(always)]
pub fn normals<const N: usize>(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    place: &ShadedPoints<'_, N>,
) -> [[f32; N]; 3] {
    if material.flags & flags::DERIVATIVE_NORMALS != 0 {
        return derivative_normals(place);
    }
    if material.flags & flags::FACE_NORMALS != 0 {
        return face_normals(surface, &place.ids, &place.b.front);
    }
    match &surface.vertex_normals {
        Some(normals) => facing(&blend(&of_corners(normals, &place.ids), &place.b.value), &place.b.front),
        None => to_viewer(&place.context.plan.projection),
    }
}

/// The normals of triangles, turned to the viewer.
#[inline(always)]
pub fn face_normals<const N: usize>(surface: &SurfacePass<'_>, ids: &[u32; N], front: &[bool; N]) -> [[f32; N]; 3] {
    let mut out = [[0.0; N]; 3];
    for l in 0..N {
        let normal = turned_to_viewer(surface.face_normals[ids[l] as usize], front[l]);
        for k in 0..3 {
            out[k][l] = normal[k];
        }
    }
    out
}

/// Shares of alpha that a material of [`flags::BY_ANGLE`] keeps where its unit normals are these: all at
/// grazing angles.
#[inline(always)]
pub fn angle_shares<const N: usize>(
    material: &ShadedMaterial,
    place: &ShadedPoints<'_, N>,
    n: &[[f32; N]; 3],
) -> [f32; N] {
    let projection = &place.context.plan.projection;
    let slope = projection.ray_slope();
    let least = material.facing_opacity;
    let mut shares = [0.0; N];
    for l in 0..N {
        let [right, down] = [slope * place.at[0][l], slope * place.at[1][l]];
        // Towards the eye.
        let ray: [f32; 3] = std::array::from_fn(|k| {
            (projection.to_viewer[k] - right * projection.screen_right[k]) + down * projection.screen_up[k]
        });
        let facing = dot([n[0][l], n[1][l], n[2][l]], ray) / dot(ray, ray).sqrt();
        let grazing = 1.0 - facing.clamp(0.0, 1.0);
        shares[l] = least + (1.0 - least) * (grazing * grazing);
    }
    shares
}

/// The direction to the viewer, in each lane.
#[inline(always)]
pub fn to_viewer<const N: usize>(projection: &Projection) -> [[f32; N]; 3] {
    projection.to_viewer.map(|v| [v; N])
}

/// The cross products of the position's fine derivatives in blocks of 2 x 2 pixels, as a GPU's
/// rasterizer has them: in f32, with the same rounding errors on both back-ends.
#[inline(always)]
fn derivative_normals<const N: usize>(place: &ShadedPoints<'_, N>) -> [[f32; N]; 3] {
    let ShadedPoints { context, ids, at, .. } = place;
    let quad = Quad::around(context.plan, at);
    let corners = corner_positions(place);
    // Bounds a neighbour beyond the horizon of the triangle's plane.
    let bounded = |b: [[f32; N]; 3]| b.map(|lanes| lanes.map(|v| v.clamp(-1e6, 1e6)));
    let [own, across, down] = quad.barycentrics(context, ids).map(|b| blend(&corners, &bounded(b)));
    // The factor keeps squares from vanishing.
    let step = |p: &[[f32; N]; 3], sign: &[f32; N]| {
        let mut d = zip(p, &own, |p, own| p - own);
        for k in 0..3 {
            for l in 0..N {
                d[k][l] *= 4096.0 * sign[l];
            }
        }
        d
    };
    let (dx, dy) = (step(&across, &quad.sign[0]), step(&down, &quad.sign[1]));
    unit_or(&cross(&dy, &dx), &to_viewer(&context.plan.projection))
}

/// The triangles' corners in the unit box: `[corner][component][lane]`.
#[inline(always)]
fn corner_positions<const N: usize>(place: &ShadedPoints<'_, N>) -> [[[f32; N]; 3]; 3] {
    let mut corners = [[[0.0; N]; 3]; 3];
    for l in 0..N {
        for (corner, (position, _)) in corners.iter_mut().zip(place.context.positions_of(place.ids[l])) {
            for k in 0..3 {
                corner[k][l] = position[k];
            }
        }
    }
    corners
}

/// The normals `n` perturbed by `texels` of the normal texture. The axes are the triangles' own:
/// increasing u and decreasing v.
#[inline(always)]
pub fn normal_mapped<const N: usize>(
    (surface, uvs): (&SurfacePass<'_>, &CornerValues<'_, [f32; 2]>),
    material: &ShadedMaterial,
    place: &ShadedPoints<'_, N>,
    texels: &[[f32; N]; 4],
    n: &[[f32; N]; 3],
) -> [[f32; N]; 3] {
    let p = corner_positions(place);
    let uv = uv_corners(surface, uvs, &material.textures[slots::NORMAL], &place.ids);
    // Texture coordinates of the corners, without the shift that all have in common.
    let rows = material.textures[slots::NORMAL].transform;
    let turned = |corner: usize, k: usize, l: usize| rows[k][0] * uv[corner][0][l] + rows[k][1] * uv[corner][1][l];
    let (e1, e2) = (zip(&p[1], &p[0], |a, b| a - b), zip(&p[2], &p[0], |a, b| a - b));
    let (mut along_u, mut along_up, mut has_axes) = ([[0.0; N]; 3], [[0.0; N]; 3], [false; N]);
    for l in 0..N {
        let d = |corner: usize| [turned(corner, 0, l) - turned(0, 0, l), turned(corner, 1, l) - turned(0, 1, l)];
        let (d1, d2) = (d(1), d(2));
        let turn = d1[0] * d2[1] - d2[0] * d1[1];
        has_axes[l] = (turn.abs() > 1e-30) & (turn.abs() < 1e30);
        // Seen from behind, bumps are dents. v runs down in the image, the texture's y up.
        let side = if (turn > 0.0) == place.b.front[l] { 1.0 } else { -1.0 };
        for k in 0..3 {
            along_u[k][l] = side * (e1[k][l] * d2[1] - e2[k][l] * d1[1]);
            along_up[k][l] = side * (e1[k][l] * d2[0] - e2[k][l] * d1[0]);
        }
    }
    let tangent = unit_or(&across(&along_u, n), &[[0.0; N]; 3]);
    let up = unit_or(&across(&across(&along_up, n), &tangent), &[[0.0; N]; 3]);
    let mut bumped = [[0.0; N]; 3];
    for l in 0..N {
        let [x, y, z] = [0, 1, 2].map(|k| 2.0 * texels[k][l] - 1.0);
        let (x, y) = (x * material.normal_scale, y * material.normal_scale);
        for k in 0..3 {
            bumped[k][l] = (x * tangent[k][l] + y * up[k][l]) + z * n[k][l];
        }
    }
    let mut out = unit_or(&bumped, n);
    for k in 0..3 {
        for l in 0..N {
            out[k][l] = if has_axes[l] { out[k][l] } else { n[k][l] };
        }
    }
    out
}
