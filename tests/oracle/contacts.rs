//! Decides, exactly, whether two triangles with integer coordinates share more than common corners
//! and a common edge. One triangle is clipped by the plane and the sides of the other, in
//! homogeneous integers, so nothing is rounded.

/// A point with integer coordinates, of at most 5 bits and a sign.
pub type Point = [i64; 3];

/// A point as three coordinates over a common, positive denominator.
type Ratio = [i128; 4];

/// True if the triangles have a point in common that is none of their common corners and lies on no
/// common edge. False for triangles without an area, and for those with the same three corners.
pub fn intersect(a: [Point; 3], b: [Point; 3]) -> bool {
    let common: Vec<Point> = a.into_iter().filter(|corner| b.contains(corner)).collect();
    if !has_area(a) || !has_area(b) || common.len() == 3 {
        return false;
    }
    let both = clipped(b, a);
    both.into_iter().any(|at| match common.as_slice() {
        [] => true,
        [v] => !is_at(at, *v),
        [v, w] => !is_on_line(at, *v, *w),
        _ => unreachable!("three corners at the most"),
    })
}

/// True if the corners do not lie on a line.
pub fn has_area(triangle: [Point; 3]) -> bool {
    normal(triangle) != [0; 3]
}

/// True if a point lies within a segment, and is none of its ends.
pub fn is_within(point: Point, [a, b]: [Point; 2]) -> bool {
    let (along, to_point) = (sub(b, a), sub(point, a));
    let share = dot(along, to_point);
    cross(along, to_point) == [0; 3] && share > 0 && share < dot(along, along)
}

/// The corners of what two triangles have in common.
fn clipped(polygon: [Point; 3], by: [Point; 3]) -> Vec<Ratio> {
    let mut left: Vec<Ratio> = polygon.map(|[x, y, z]| [x, y, z, 1].map(i128::from)).to_vec();
    let facing = normal(by);
    let mut cut = |normal: [i128; 3], through: Point| {
        let beside = dot(normal, through.map(i128::from));
        left = half(&left, reduced([normal[0], normal[1], normal[2], -beside]));
    };
    cut(facing, by[0]);
    cut(facing.map(|c| -c), by[0]);
    for [from, to] in [[by[0], by[1]], [by[1], by[2]], [by[2], by[0]]] {
        cut(cross(facing, sub(to, from)), from);
    }
    left
}

/// The part of a convex polygon on the positive side of a plane, which belongs to it.
fn half(polygon: &[Ratio], plane: Ratio) -> Vec<Ratio> {
    let height = |at: &Ratio| -> i128 { at.iter().zip(plane).map(|(c, n)| c * n).sum() };
    let mut part = Vec::new();
    for (i, at) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        let (here, there) = (height(at), height(next));
        if here >= 0 {
            part.push(*at);
        }
        if here.signum() * there.signum() < 0 {
            part.push(reduced(std::array::from_fn(|k| at[k] * there.abs() + next[k] * here.abs())));
        }
    }
    part
}

fn is_at(at: Ratio, point: Point) -> bool {
    (0..3).all(|k| at[k] == i128::from(point[k]) * at[3])
}

fn is_on_line(at: Ratio, v: Point, w: Point) -> bool {
    let from_v: [i128; 3] = std::array::from_fn(|k| at[k] - i128::from(v[k]) * at[3]);
    cross(from_v, sub(w, v)) == [0; 3]
}

fn normal([a, b, c]: [Point; 3]) -> [i128; 3] {
    cross(sub(b, a), sub(c, a))
}

fn sub(a: Point, b: Point) -> [i128; 3] {
    std::array::from_fn(|k| i128::from(a[k] - b[k]))
}

fn dot(a: [i128; 3], b: [i128; 3]) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [i128; 3], b: [i128; 3]) -> [i128; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The same four numbers without a common factor.
fn reduced(all: Ratio) -> Ratio {
    let gcd = all.iter().fold(0, |a, b| gcd(a, b.abs()));
    if gcd == 0 { all } else { all.map(|c| c / gcd) }
}

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}
