// The definitions that shaders share: the types of the uniforms, constants, the positions of samples in a pixel,
// and arithmetic that gives the same bits as the CPU's (docs/rasterizer.md, "Rounded operations").
//
// Uses: one_job.wgsl or gang.wgsl (batch, frame).

struct Frame {
    x_row: vec4<f32>,
    y_row: vec4<f32>,
    z_row: vec4<f32>,
    w_row: vec4<f32>,
    screen_up: vec4<f32>,
    screen_right: vec4<f32>,
    // The last word is the slope of rays, see Projection::ray_slope in src/render/plan/projection.rs.
    to_viewer: vec4<f32>,
    // Towards each lamp, and how strong it is.
    lamps: array<vec4<f32>, 3>,
    halfways: array<vec4<f32>, 3>,
    // At the picture's upper edge, and what each row adds to it.
    background: vec4<f32>,
    background_step: vec4<f32>,
    hull_color: vec4<f32>,
    near_w: f32,
    ambient: f32,
    lamp_count: u32,
    // Always 0, but unknown to the compiler.
    zero: u32,
    width: i32,
    height: i32,
    triangle_count: u32,
    vertex_count: u32,
    // Start of the edge masks in the attributes; triangles' materials start at 0.
    masks_at: u32,
    material_count: u32,
    // Opacity of wires from the second layer on.
    layer_fade: f32,
    // Number of colours at the start of hull_materials; the triangles' materials follow.
    hull_color_count: u32,
    // Textures; what each is, is in front of the texels.
    image_count: u32,
    // Start of the indices of each kind of corner value in corner_triangles.
    normal_triangles_at: u32,
    uv_triangles_at: u32,
    color_triangles_at: u32,
    // Occlusion: src/render/plan/surface/occlusion.rs explains it. To places, and how strong it is.
    occlusion_depth: vec4<f32>,
    // Width of a pixel, then which places, and which depths, may be of one surface.
    occlusion_spread: vec4<f32>,
    // Places that pixels look at, columns in the low halves.
    taps: array<vec4<u32>, 16>,
    // 1 / radius^2.
    occlusion_reach: f32,
    // Start of the second set of texture coordinates in uvs.
    second_uvs_at: u32,
    // Start of the job's vertices, items of the work list and pixels: not 0 for jobs of a gang.
    vertices_at: u32,
    items_at: u32,
    pixels_at: u32,
    // 1 if layers tint lines, else 0.
    has_tints: u32,
    // 1 if triangles may be shaded in each quarter of a pixel, else 0.
    has_quarters: u32,
    padding_a: u32,
};

// Parameters of a dispatch: its triangles, vertices or edges, and the rows of the picture that the
// buffers hold.
struct Batch {
    first: u32,
    count: u32,
    // 0 both, 1 front, 2 back.
    faces: u32,
    row_first: i32,
    row_end: i32,
    // Items that the work list holds.
    capacity: u32,
    // Range of items that a dispatch of the tile kernel draws.
    large_first: u32,
    large_end: u32,
    huge_first: u32,
    huge_end: u32,
    // Edges that a workgroup draws.
    edges_per_group: u32,
    // The line pass: width and ramp in pixels, and bits.
    line_width: f32,
    line_smoothing: f32,
    line_flags: u32,
    // Scale of areas in a stroke, as a power of two; windows of an edge in a pixel of it.
    line_exponent: u32,
    line_windows: f32,
    // Threads that share a window, by rows.
    line_slices: u32,
    // Coverage in the middle of a line.
    line_peak: f32,
    // Units of work after which a workgroup pauses.
    line_units: u32,
    line_pass: u32,
    // Rows that the visibility buffer holds, which may be more than the batch's, and the index of
    // the batch's first sample in it.
    seen_first: i32,
    seen_end: i32,
    samples_at: u32,
    // Bit that the pass mask of a drawn triangle has; 0 for the outline mesh, which has no masks.
    pass_bit: u32,
    // Number of the layer that is looked for; 0 also for the visibility buffer.
    layer: u32,
    // First column in which triangles are drawn, and the column after the last; columns beyond the
    // picture count.
    column_first: i32,
    column_end: i32,
    // Columns beyond the picture, on each side.
    seen_margin: i32,
    // Size of the largest triangle that a thread draws by itself, 1/256 px. At most 4096, so that edge values
    // fit 32 bits.
    alone_size: i32,
    // Workgroups that share a triangle where there are few.
    groups_each: u32,
    // Samples that the transform stage empties.
    cleared: u32,
    // Where the batch's first pixel is in the bytes of the picture.
    rgba_at: u32,
    // Numbers of the first mixed pixel whose points the buffer holds, and of the one after the last.
    slots_first: u32,
    slots_end: u32,
    // Items of the lists of mixed pixels, and parts of their colours, that there is room for.
    list_capacity: u32,
    part_capacity: u32,
    // The line pass's, see LinePass::tint_reach in src/render/plan/lines/mod.rs.
    tint_reach: f32,
    // The line pass's, see LinePass::unseen_part_px and LinePass::farther_samples_max there.
    unseen_part: f32,
    farther_samples: u32,
    // The place of the line pass's opacities in line_colors (coverage.wgsl); 0 if it has none.
    line_fade: u32,
};

// Threads of a workgroup, in every kernel.
const WORKGROUP: u32 = 64u;

// Jobs in a gang, at most.
const JOBS_MAX: u32 = 16u;

// Vectors of four words per item of the work list.
const ITEM_VECTORS: u32 = 3u;

// Values of `faces`.
const FACES_BOTH: u32 = 0u;
const FACES_FRONT: u32 = 1u;
const FACES_BACK: u32 = 2u;

// Bits of `line_flags`.
// Strokes are those of the parts that nothing hides.
const SHOWN_VISIBLE: u32 = 1u;
// Hidden parts are drawn too, fainter. Without SHOWN_VISIBLE, strokes are those of whole edges, of which coverage.wgsl
// keeps the share that they cover.
const FADES_HIDDEN: u32 = 2u;
const SKIP_BACK: u32 = 4u;
const CONTOUR: u32 = 8u;
const LIT_PASS: u32 = 16u;
const FIRST_PASS: u32 = 32u;
// It is the fronts of faces that look away, because the surface is inside out.
const INSIDE_OUT: u32 = 64u;
// Only pixels that are marked get strokes; elsewhere holes tell what lines cover.
const HOLES: u32 = 128u;
// Rims alone are drawn, and the pixels that they reach marked.
const RIM_PASS: u32 = 256u;
// Layers tint the lines.
const TINTED_PASS: u32 = 512u;
// Edges name all of their faces.
const NAMES_ALL_FACES: u32 = 1024u;
// Edges between two faces with fringes are left out, unless they are silhouettes.
const FRINGES: u32 = 2048u;

const SURFACE: u32 = 1u;
const HULL: u32 = 2u;
const FACE_NORMALS: u32 = 8u;
const VERTEX_NORMALS: u32 = 16u;
const WIRES: u32 = 32u;
const TRIANGLE_MATERIALS: u32 = 64u;
const EDGE_MASKS: u32 = 128u;
const LINES: u32 = 256u;
const CLIPPED: u32 = 2048u;
const EIGHT_SAMPLES: u32 = 512u;
const SIXTEEN_SAMPLES: u32 = 1024u;
const FOUR_SAMPLES: u32 = 4096u;
const LIT_LINES: u32 = 8192u;
// A line pass is a contour.
const CONTOURS: u32 = 16384u;
// Holes in faces tell what a line pass covers.
const HOLED: u32 = 32768u;
const PASS_MASKS: u32 = 0x100000u;
// Hollows go without some of the light.
const OCCLUSION: u32 = 0x200000u;
const HULL_MATERIALS: u32 = 0x400000u;
const PEELING: u32 = 0x800000u;
const BEHIND_SURFACE: u32 = 0x1000000u;
const WIRES_ONLY: u32 = 0x2000000u;
const PEELED_HULL: u32 = 0x4000000u;

// Bits of a triangle's pass mask, see src/render/plan/mod.rs.
const PASS_LAYER: u32 = 2u;
const PASS_FRONT_ONLY: u32 = 8u;
const PASS_BACK_ONLY: u32 = 16u;
const DERIVATIVE_NORMALS: u32 = 65536u;
const VERTEX_COLORS: u32 = 131072u;
const UVS: u32 = 262144u;
const TEXTURES: u32 = 524288u;
// Wires by the smallest coordinate.
const WIRE_MINIMUM: u32 = 0x8000000u;
const WIRE_LIT: u32 = 0x10000000u;
const DEBUG: u32 = 0x20000000u;
// Colours vary over a triangle.
const VARYING: u32 = 0x40000000u;
// Some pixels are mixed.
const ADAPTIVE: u32 = 0x80000000u;

// Bits of the above. A constant of the pipeline, so that a kernel contains only the code that its
// plan needs.
override PIPELINE_KEY: u32 = 0u;

fn has(flag: u32) -> bool {
    return (PIPELINE_KEY & flag) != 0u;
}

// Samples per pixel.
fn sample_count() -> i32 {
    return select(select(select(1, 4, has(FOUR_SAMPLES)), 8, has(EIGHT_SAMPLES)), 16, has(SIXTEEN_SAMPLES));
}

// Index in the visibility buffer of the first sample of pixel number i of the batch's rows.
fn first_visibility_sample(i: u32) -> u32 {
    let row = u32(i32(i) / frame.width);
    return batch.samples_at + u32(sample_count()) * (i + 2u * u32(batch.seen_margin) * row);
}

struct Vertex {
    x: i32,
    y: i32,
    z: f32,
    inv_w: f32,
};

// `x` of a vertex that is behind the near plane or beyond the guard band.
const OUTSIDE: i32 = i32(-0x80000000);

// Rounds a product by itself: nothing can be fused through this.
fn rn(v: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(v) ^ frame.zero);
}

fn rn2(v: vec2<f32>) -> vec2<f32> {
    return bitcast<vec2<f32>>(bitcast<vec2<u32>>(v) ^ vec2(frame.zero));
}

fn rn3(v: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(v) ^ vec3(frame.zero));
}

fn rn4(v: vec4<f32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(bitcast<vec4<u32>>(v) ^ vec4(frame.zero));
}

// 1 / w for positive normal w.
fn recip(w: f32) -> f32 {
    var r = bitcast<f32>(0x7EF311C7u - bitcast<u32>(w));
    for (var i = 0; i < 4; i++) {
        // The residual is exact close to the end, so that recip(1) is 1 and not the number below
        // it.
        r = r + rn(r * (1.0 - rn(w * r)));
    }
    return r;
}

// 1 / w for positive normal w, for colours: an iteration less.
fn quick_recip(w: f32) -> f32 {
    var r = bitcast<f32>(0x7EF311C7u - bitcast<u32>(w));
    r = rn(r * (2.0 - rn(w * r)));
    r = rn(r * (2.0 - rn(w * r)));
    return rn(r * (2.0 - rn(w * r)));
}

// 1 / sqrt(v) for positive normal v.
fn rsqrt(v: f32) -> f32 {
    var r = bitcast<f32>(0x5F3759DFu - (bitcast<u32>(v) >> 1u));
    for (var i = 0; i < 4; i++) {
        r = rn(r * (1.5 - rn(rn(rn(0.5 * v) * r) * r)));
    }
    return r;
}

// 1 / sqrt(v) for positive normal v within 5e-6 of it.
fn quick_rsqrt(v: f32) -> f32 {
    var r = bitcast<f32>(0x5F3759DFu - (bitcast<u32>(v) >> 1u));
    let half = 0.5 * v;
    r = rn(r * (1.5 - rn(rn(half * r) * r)));
    return rn(r * (1.5 - rn(rn(half * r) * r)));
}

// To the nearest integer, ties to even, for |v| < 2^22.
fn round_to_i32(v: f32) -> i32 {
    return bitcast<i32>(rn(v + 12582912.0)) - 0x4B400000;
}

// Share of the brightest value below which light is shown as it is.
const SHOULDER: f32 = 0.8;

// Values of light that are shown: as they are up to the shoulder, and above it nearing `white`.
fn rolled_off(v: vec3<f32>, white: f32) -> vec3<f32> {
    let start = rn(SHOULDER * white);
    let room = white - start;
    let over = max(v - start, vec3(0.0));
    let sum = max(room + over, vec3(1e-30));
    let inverse = vec3(quick_recip(sum.x), quick_recip(sum.y), quick_recip(sum.z));
    return min(max(v, vec3(0.0)), vec3(start)) + rn3(rn3(room * over) * inverse);
}

// row . (p, 1)
fn row_dot(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return rn(rn(rn(row.x * p.x) + rn(row.y * p.y)) + rn(row.z * p.z)) + row.w;
}

// a . b
fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    let p = rn3(a * b);
    return rn(p.x + p.y) + p.z;
}

// Homogeneous screen position.
fn homogeneous(p: vec3<f32>) -> vec4<f32> {
    return vec4(row_dot(frame.x_row, p), row_dot(frame.y_row, p), row_dot(frame.z_row, p), row_dot(frame.w_row, p));
}

// 64-bit integers as (low, high) words in two's complement.

fn mul_wide(a: i32, b: i32) -> vec2<u32> {
    let p = u32(abs(a));
    let q = u32(abs(b));
    let low = (p & 0xFFFFu) * (q & 0xFFFFu);
    let mid = (p >> 16u) * (q & 0xFFFFu) + (low >> 16u);
    let mid2 = (p & 0xFFFFu) * (q >> 16u) + (mid & 0xFFFFu);
    let v = vec2(p * q, (p >> 16u) * (q >> 16u) + (mid >> 16u) + (mid2 >> 16u));
    if (a ^ b) < 0 {
        return negate_wide(v);
    }
    return v;
}

fn negate_wide(v: vec2<u32>) -> vec2<u32> {
    return vec2(~v.x + 1u, ~v.y + select(0u, 1u, v.x == 0u));
}

fn sub_wide(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2(a.x - b.x, a.y - b.y - select(0u, 1u, a.x < b.x));
}

// The f32 of a value >= 0.
fn wide_to_f32(v: vec2<u32>) -> f32 {
    return rn(f32(v.y) * 4294967296.0) + f32(v.x);
}

// Positions of samples as sample_offsets() in src/render/plan/mod.rs has them, in 1/16 px: a nibble per
// sample, the first lowest.
const ONE_SAMPLE_XY: u32 = 0x8u;
const FOUR_SAMPLES_X: u32 = 0xA2E6u;
const FOUR_SAMPLES_Y: u32 = 0xEA62u;
const EIGHT_SAMPLES_X: u32 = 0xFB135D79u;
const EIGHT_SAMPLES_Y: u32 = 0x1F7D39B5u;
const SIXTEEN_SAMPLES_X_FIRST: u32 = 0xBDA3C579u;
const SIXTEEN_SAMPLES_X_LAST: u32 = 0x1EF02486u;
const SIXTEEN_SAMPLES_Y_FIRST: u32 = 0x3BD67A59u;
const SIXTEEN_SAMPLES_Y_LAST: u32 = 0x0F48C21Eu;
// Common remainder of the 16 samples' positions modulo 1/16 px, in 1/256 px.
const SIXTEEN_SAMPLES_SHIFT: i32 = 8;

// Position of sample s, in 1/16 px from sample_corner().
fn sample_step(s: i32) -> vec2<i32> {
    var x = ONE_SAMPLE_XY;
    var y = ONE_SAMPLE_XY;
    if has(FOUR_SAMPLES) {
        x = FOUR_SAMPLES_X;
        y = FOUR_SAMPLES_Y;
    }
    if has(EIGHT_SAMPLES) {
        x = EIGHT_SAMPLES_X;
        y = EIGHT_SAMPLES_Y;
    }
    if has(SIXTEEN_SAMPLES) {
        x = select(SIXTEEN_SAMPLES_X_FIRST, SIXTEEN_SAMPLES_X_LAST, s >= 8);
        y = select(SIXTEEN_SAMPLES_Y_FIRST, SIXTEEN_SAMPLES_Y_LAST, s >= 8);
    }
    let nibble = 4u * u32(s & 7);
    return vec2<i32>(vec2((x >> nibble) & 15u, (y >> nibble) & 15u));
}

// The same in 1/256 px from the pixel's upper left corner.
fn sample_offset(s: i32) -> vec2<i32> {
    return 16 * sample_step(s) + sample_shift();
}

fn sample_shift() -> i32 {
    return select(0, SIXTEEN_SAMPLES_SHIFT, has(SIXTEEN_SAMPLES));
}

// Upper left corner of a pixel in 1/256 px from the picture's centre.
fn pixel_corner(pixel: vec2<i32>) -> vec2<i32> {
    return pixel * 256 - vec2(frame.width, frame.height) * 128;
}

// The same, moved so that all samples lie multiples of 1/16 px away.
fn sample_corner(pixel: vec2<i32>) -> vec2<i32> {
    return pixel_corner(pixel) + sample_shift();
}
