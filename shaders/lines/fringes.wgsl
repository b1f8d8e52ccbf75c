// Fringes: what lines along all edges of a mesh cover inside its faces, seen or hidden (stage lines, per triangle and
// word of a pixel's mask: a thread that tested all points of a large face's pixels would take longest of all).
// The fringe of a face is the part of it that is less than half a line's width from one of its sides. The kernel
// tests a pixel's 256 coverage points, and adds those in the fringe to what strokes cover in the pixel (a stroke is
// the area that the line of one part of an edge covers). Twin of src/render/backend/cpu/lines/fringes.rs, which says
// why strokes are then only needed along rims and the sides of wide faces.
//
// Uses: common.wgsl (rn, round_to_i32, Vertex, WORKGROUP), one_job.wgsl (batch, frame),
// geometry/culling.wgsl (passes_culling), geometry/triangle.wgsl (area_of), lines/fringed.wgsl
// (is_fringed), lines/holes/inset.wgsl (inset_of), lines/lattice.wgsl (lattice_points, product),
// lines/stroke_words.wgsl (MASK_WORD, MASK_WORDS, STROKE_WORDS).

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;

// Steps to the pixel in which distances from sides are measured.
const FRINGE_UNIT: f32 = 4096.0;

// Largest distance of a pixel's centre from a side that is told apart, pixels.
const FRINGE_FAR_PX: f32 = 5.0;

// A pixel is passed over only if its points are this much too far from a side, in these steps: more than rounding.
const FRINGE_SLACK: i32 = 32;

// The sides of a face, as the points of a pixel are compared with them.
struct FringeSides {
    // Unit vectors inwards.
    normals: array<vec2<i32>, 3>,
    // Distances of the pixel's centre.
    offsets: vec3<i32>,
    // Half the lines' width.
    limit: i32,
};

@compute @workgroup_size(WORKGROUP)
fn fringes(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count * MASK_WORDS {
        return;
    }
    let t = batch.first + i / MASK_WORDS;
    let a = vertices[triangles[3u * t]];
    let b = vertices[triangles[3u * t + 1u]];
    let c = vertices[triangles[3u * t + 2u]];
    if !is_fringed(a, b, c) || !passes_culling(t, area_of(a, b, c)) {
        return;
    }
    let half = vec2(frame.width, frame.height) * 128;
    let corners = array<vec2<i32>, 3>(vec2(a.x, a.y), vec2(b.x, b.y), vec2(c.x, c.y));
    let low = min(min(corners[0], corners[1]), corners[2]) + half;
    let high = max(max(corners[0], corners[1]), corners[2]) + half;
    let first = max(low >> vec2(8u), vec2(0, batch.row_first));
    let last = min((high - 1) >> vec2(8u), vec2(frame.width, batch.row_end) - 1);
    let inset = inset_of(corners[0], corners[1], corners[2]);
    var sides: FringeSides;
    var extents = vec3(0);
    for (var k = 0; k < 3; k++) {
        let normal = vec2(-inset.sides[k].unit.y, inset.sides[k].unit.x);
        sides.normals[k] = vec2(round_to_i32(normal.x * FRINGE_UNIT), round_to_i32(normal.y * FRINGE_UNIT));
        extents[k] = round_to_i32((0.5 * FRINGE_UNIT) * (abs(normal.x) + abs(normal.y))) + FRINGE_SLACK;
    }
    sides.limit = round_to_i32((batch.line_width * 128.0) * (FRINGE_UNIT / 256.0));
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let center = vec2<f32>(vec2(x, y) * 256 + 128 - half);
            for (var k = 0; k < 3; k++) {
                let from_corner = center - inset.sides[k].corner;
                sides.offsets[k] = offset_of(
                    rn(inset.sides[k].unit.x * from_corner.y) - rn(inset.sides[k].unit.y * from_corner.x),
                );
            }
            if all(sides.offsets > -extents) && any(sides.offsets < extents + sides.limit) {
                add_points_of(sides, u32((y - batch.row_first) * frame.width + x), i % MASK_WORDS);
            }
        }
    }
}

// A distance from a side, in 1/256 px, in steps.
fn offset_of(distance: f32) -> i32 {
    let far = FRINGE_FAR_PX * FRINGE_UNIT;
    return round_to_i32(clamp(distance * (FRINGE_UNIT / 256.0), -far, far));
}

// Adds the points of word w of a pixel's mask that lie in the fringe.
fn add_points_of(sides: FringeSides, pixel_at: u32, w: u32) {
    let at = pixel_at * STROKE_WORDS + MASK_WORD + w;
    let covered = atomicLoad(&strokes[at]);
    if covered == 0xFFFFFFFFu {
        return;
    }
    var mask = 0u;
    // frame.zero keeps compilers from unrolling the loop.
    for (var half = 0u; half < 2u + frame.zero; half++) {
        let word = 2u * w + half;
        let points = points_of_fringe(sides, word, 0u) | points_of_fringe(sides, word, 4u)
            | points_of_fringe(sides, word, 8u) | points_of_fringe(sides, word, 12u);
        mask |= points << (16u * half);
    }
    if (mask & ~covered) != 0u {
        atomicOr(&strokes[at], mask);
    }
}

// Those of four points of a word, from bit `first` on, that lie in the fringe.
fn points_of_fringe(sides: FringeSides, word: u32, first: u32) -> u32 {
    let points = lattice_points(word, first);
    let x = points.x;
    let y = points.y;
    let a = product(sides.normals[0], x, y) + sides.offsets.x;
    let b = product(sides.normals[1], x, y) + sides.offsets.y;
    let c = product(sides.normals[2], x, y) + sides.offsets.z;
    let least = min(min(a, b), c);
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), (least >= vec4(0)) & (least < vec4(sides.limit)));
    return ((bits.x | bits.y) | (bits.z | bits.w)) << first;
}
