//! Arithmetic of vectors with three components, such as products and unit vectors, for the stages
//! shade and mixed. Functions take one vector, or `N` side by side as `[component][lane]`.

/// Scalar product.
#[inline(always)]
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]
}

/// Scalar products.
#[inline(always)]
pub fn dots<const N: usize>(a: &[[f32; N]; 3], b: &[[f32; N]; 3]) -> [f32; N] {
    let mut out = [0.0; N];
    for l in 0..N {
        out[l] = (a[0][l] * b[0][l] + a[1][l] * b[1][l]) + a[2][l] * b[2][l];
    }
    out
}

/// `each` applied to the components of two vectors.
#[inline(always)]
pub fn zip<const N: usize>(a: &[[f32; N]; 3], b: &[[f32; N]; 3], each: impl Fn(f32, f32) -> f32) -> [[f32; N]; 3] {
    let mut out = [[0.0; N]; 3];
    for k in 0..3 {
        for l in 0..N {
            out[k][l] = each(a[k][l], b[k][l]);
        }
    }
    out
}

/// Vector products.
#[inline(always)]
pub fn cross<const N: usize>(a: &[[f32; N]; 3], b: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let mut out = [[0.0; N]; 3];
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        for l in 0..N {
            out[k][l] = a[i][l] * b[j][l] - a[j][l] * b[i][l];
        }
    }
    out
}

/// Components of `v` at right angles to the unit vectors `n`; about unit length where they are not
/// zero.
#[inline(always)]
pub fn across<const N: usize>(v: &[[f32; N]; 3], n: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let mut largest = [0.0_f32; N];
    for k in 0..3 {
        for l in 0..N {
            largest[l] = largest[l].max(v[k][l].abs());
        }
    }
    let mut v = *v;
    for k in 0..3 {
        for l in 0..N {
            v[k][l] = if largest[l] > 0.0 { v[k][l] / largest[l] } else { v[k][l] };
        }
    }
    let along = dots(&v, n);
    for k in 0..3 {
        for l in 0..N {
            v[k][l] -= along[l] * n[k][l];
        }
    }
    v
}

/// The unit vectors, or `otherwise` where `v` is too short or too long to have a direction.
#[inline(always)]
pub fn unit_or<const N: usize>(v: &[[f32; N]; 3], otherwise: &[[f32; N]; 3]) -> [[f32; N]; 3] {
    let squares = dots(v, v);
    let mut out = [[0.0; N]; 3];
    for k in 0..3 {
        for l in 0..N {
            let has_direction = (squares[l] > 1e-20) & (squares[l] < 1e30);
            let unit = v[k][l] / squares[l].sqrt();
            out[k][l] = if has_direction { unit } else { otherwise[k][l] };
        }
    }
    out
}

/// A face's unit normal on the viewer's side. It is not normalised again, so that it keeps its
/// bits.
#[inline(always)]
pub fn turned_to_viewer(n: [f32; 3], front: bool) -> [f32; 3] {
    if front { n } else { [-n[0], -n[1], -n[2]] }
}

/// The unit normals on the viewer's side of interpolated corner normals.
#[inline(always)]
pub fn facing<const N: usize>(n: &[[f32; N]; 3], front: &[bool; N]) -> [[f32; N]; 3] {
    let squares = dots(n, n);
    let mut scale = [0.0; N];
    for l in 0..N {
        let inverse = 1.0 / squares[l].sqrt();
        let size = if squares[l] > 1e-20 { inverse } else { 0.0 };
        scale[l] = if front[l] { size } else { -size };
    }
    let mut out = *n;
    for k in 0..3 {
        for l in 0..N {
            out[k][l] *= scale[l];
        }
    }
    out
}

/// `N` values from `first` on, a multiple of it.
#[inline(always)]
pub fn part<T: Copy + Default, const N: usize, const ALL: usize>(all: &[T; ALL], first: usize) -> [T; N] {
    all.get(first..).and_then(|all| all.first_chunk()).copied().unwrap_or([T::default(); N])
}
