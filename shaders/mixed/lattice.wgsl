// Stage mixed: the coverage points of a pixel. Twin of src/backend/cpu/mixed/points.rs.

const POINTS: u32 = 256u;
const GENERATOR: u32 = 181u;

// Of so many points, one is among few. The second of four is the first.
const FEW_STEP: u32 = 4u;
const FEW_FIRST: u32 = 1u;

// Column and row of point i in its pixel, 1/256 px, without the half.
fn point_place(i: u32) -> vec2<i32> {
    return vec2<i32>(vec2(i, (i * GENERATOR) % POINTS));
}
