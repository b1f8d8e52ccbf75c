// The conversion of a pixel's colour from linear light to the sRGB bytes of the picture (stage resolve). Used by
// resolve.wgsl and paint.wgsl. The CPU's counterpart is in src/render/backend/cpu/resolve.rs.
//
// Uses: common.wgsl (recip, rn, rn3).

// thresholds[k] is the smallest linear value that is stored as k + 1 or more.
@group(1) @binding(13) var<storage, read> thresholds: array<f32>;
@group(1) @binding(14) var<storage, read_write> rgba: array<u32>;

fn encode(c: vec4<f32>) -> u32 {
    if c.w <= 0.0 {
        return 0u;
    }
    var color = c.xyz;
    var alpha = 255u;
    if c.w < 1.0 {
        // The bound keeps recip in its range: fainter colours leave no bit.
        color = rn3(color * recip(max(c.w, 1e-30)));
        alpha = u32(rn(c.w * 255.0) + 0.5);
    }
    return srgb(color.x) | (srgb(color.y) << 8u) | (srgb(color.z) << 16u) | (alpha << 24u);
}

// Number of thresholds that are not above v. The formula is within one step of it; the table
// decides.
fn srgb(v: f32) -> u32 {
    let c = clamp(v, 0.0, 1.0);
    let encoded = select(1.055 * exp2(log2(max(c, 1e-6)) * (1.0 / 2.4)) - 0.055, 12.92 * c, c <= 0.0031308);
    let guess = u32(clamp(encoded * 255.0 + 0.5, 1.0, 254.0));
    return guess - u32(v < thresholds[guess - 1u]) + u32(v >= thresholds[guess]);
}
