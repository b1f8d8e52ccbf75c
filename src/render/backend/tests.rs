//! Tests that the shaders and the Rust code beside them agree on constants and on structs in buffers.
//!
//! Rust cannot read WGSL, so both sides write these down. The tests parse the shaders and compare each constant and
//! field. A constant that neither [`shared_constants`] nor [`SHADER_ONLY`] lists is a failure too.

use std::collections::BTreeMap;
use std::mem::offset_of;

use wgpu::naga;

use super::cpu::geometry::transform::{GUARD, OUTSIDE, ScreenVertex};
use super::cpu::geometry::{clip, samples, steepness};
use super::cpu::lines::holes::{self, inset, tips};
use super::cpu::lines::{coplanar, coverage, fringes, hidden_lines, profile, segment, stroke};
use super::cpu::mixed::find::breaks;
use super::cpu::mixed::find::look::{self, kinds};
use super::cpu::mixed::find::thin;
use super::cpu::mixed::thinness;
use super::cpu::mixed::{points, triangle};
use super::cpu::occlusion;
use super::cpu::peeling::tints;
use super::cpu::surface::{light, texture};
use super::gpu::params::{Batch, FACES_BACK, FACES_BOTH, FACES_FRONT, Frame, OWN_TRIANGLES, line_flags};
use super::gpu::pipelines::key;
use super::gpu::pipelines::tests::parsed;
use super::gpu::schedule::sizes::{
    JOBS_MAX, MIXED_HEAD_BYTES, PEEL_STATE_BYTES, STROKES_BYTES, WORK_HEAD_BYTES, WORK_ITEM_BYTES,
};
use super::gpu::schedule::{PIECES_MAX, WORKGROUP, line_shares, tiles};
use super::sample_partition::{GENERATORS, POINTS};
use crate::plan::{
    ALPHA_MIN, Edge, FADE, LinePass, MIRROR_ROUGHNESS, OutermostSamples, ShadedMaterial, TAPS_PER_PIXEL, TEXTURE_NONE,
    TINTS, Texture, debug_views, flags, pass_mask, sample_offsets, samplers, slots,
};

/// Every constant that a shader and Rust both have, as the shader calls it.
#[expect(clippy::too_many_lines, reason = "a table")]
fn shared_constants() -> BTreeMap<&'static str, f64> {
    let mut all = BTreeMap::new();
    macro_rules! add {
        ($($name:literal = $value:expr),* $(,)?) => {
            $(assert!(all.insert($name, $value as f64).is_none(), "{} twice", $name);)*
        };
    }
    macro_rules! add_same {
        ($prefix:literal, $module:ident: $($name:ident)*) => {
            $(assert!(all.insert(concat!($prefix, stringify!($name)), $module::$name as f64).is_none());)*
        };
    }
    // Pipeline key.
    add_same!("", key: SURFACE HULL FACE_NORMALS VERTEX_NORMALS WIRES TRIANGLE_MATERIALS EDGE_MASKS LINES CLIPPED
        EIGHT_SAMPLES SIXTEEN_SAMPLES FOUR_SAMPLES LIT_LINES CONTOURS HOLED PASS_MASKS OCCLUSION HULL_MATERIALS PEELING BEHIND_SURFACE
        WIRES_ONLY PEELED_HULL DERIVATIVE_NORMALS VERTEX_COLORS UVS TEXTURES WIRE_MINIMUM WIRE_LIT DEBUG VARYING ADAPTIVE);
    // Line flags, pass masks, faces.
    add_same!("", line_flags: SHOWN_VISIBLE FADES_HIDDEN SKIP_BACK CONTOUR LIT_PASS FIRST_PASS INSIDE_OUT HOLES
        RIM_PASS TINTED_PASS NAMES_ALL_FACES FRINGES);
    add!(
        "PASS_LAYER" = pass_mask::LAYER,
        "PASS_FRONT_ONLY" = pass_mask::FRONT_ONLY,
        "PASS_BACK_ONLY" = pass_mask::BACK_ONLY
    );
    add!("FACES_BOTH" = FACES_BOTH, "FACES_FRONT" = FACES_FRONT, "FACES_BACK" = FACES_BACK);
    // Materials: flags, slots, debug views, samplers.
    add_same!("MATERIAL_", flags: FILL FACE_NORMALS DERIVATIVE_NORMALS LIT VERTEX_COLORS MASK BLEND WIRE_BARYCENTRIC
        WIRE_FWIDTH_MIN WIRE_FWIDTH WIRES WIRE_LIT DEBUG_SHIFT OWN_METALLIC OWN_ROUGHNESS BY_ANGLE);
    add_same!("SLOT_", slots: BASE METALLIC_ROUGHNESS NORMAL EMISSIVE OCCLUSION_TEXTURE);
    add_same!("DEBUG_", debug_views: BARYCENTRIC MIN_BARYCENTRIC EDGE_DISTANCE NORMAL UV FACE_ORIENTATION VERTEX_COLOR);
    add!("JOBS_MAX" = JOBS_MAX);
    add!("WRAP_BITS" = samplers::WRAP_BITS, "WRAP_DOWN_SHIFT" = samplers::DOWN_SHIFT);
    add!("WRAP_REPEAT" = samplers::REPEAT, "WRAP_MIRROR" = samplers::MIRROR, "SAMPLER_NEAREST" = samplers::NEAREST);
    add!("SAMPLER_SECOND_UVS" = samplers::SECOND_UVS, "SAMPLER_CUT_OUT" = samplers::CUT_OUT);
    add!("SAMPLER_TRILINEAR" = samplers::TRILINEAR);
    // Values that mean something else than a number.
    add!(
        "OUTSIDE" = OUTSIDE,
        "NOTHING" = samples::NOTHING,
        "NO_FACE" = Edge::NO_FACE,
        "NO_LIMIT" = line_shares::NO_LIMIT
    );
    add!("OWN_TRIANGLES" = OWN_TRIANGLES);
    // Sizes and limits.
    add!("WORKGROUP" = WORKGROUP, "ITEM_VECTORS" = WORK_ITEM_BYTES / 16, "STROKE_WORDS" = STROKES_BYTES / 4);
    add!("MASK_WORDS" = POINTS / 32, "IMAGE_VECTORS" = size_of::<Texture>() / 8);
    add!("TILE_PX" = tiles::TILE_PX, "HUGE_PX" = tiles::HUGE_PX, "CORNERS_MAX" = clip::CORNERS_MAX);
    add!("GUARD" = GUARD, "BOUND" = clip::BOUND, "UV_MAX" = texture::UV_MAX, "MIN_POSITIVE" = f32::MIN_POSITIVE);
    add!("TAPS_MAX" = samplers::TAPS_MAX);
    // Lines.
    add!("POINTS" = POINTS, "GENERATOR" = GENERATORS[1], "AREA_UNIT" = coverage::AREA_UNIT, "UNIT" = stroke::UNIT);
    add!(
        "LIMIT" = LinePass::SCALED_MAX,
        "BOX_RADIUS" = std::f32::consts::FRAC_1_SQRT_2,
        "SLACK_PX" = segment::SLACK_PX
    );
    add!(
        "STROKES_SIDE_BY_SIDE" = coverage::STROKES_SIDE_BY_SIDE,
        "ALPHA_MIN" = ALPHA_MIN,
        "TINTS" = TINTS,
        "FADE" = FADE
    );
    add!("EDGE_ON" = tints::EDGE_ON);
    add!("NEARER_RATIO" = steepness::NEARER_RATIO, "SNAP_ERROR" = hidden_lines::SNAP_ERROR);
    add!("INTERVAL_MIN_PX" = hidden_lines::INTERVAL_MIN_PX, "GAP_MIN_PX" = hidden_lines::GAP_MIN_PX);
    add!("SIDE_MARGIN" = coplanar::SIDE_MARGIN, "IN_PLANE" = coplanar::IN_PLANE);
    add!("IDS_MAX" = line_shares::IDS_MAX, "INTERVALS_MAX" = line_shares::INTERVALS_MAX);
    add!("LINE_THREADS" = line_shares::LINE_THREADS);
    add!("GAUSS_PLACE" = profile::GAUSS_PLACE, "GAUSS_OUTER" = profile::GAUSS_OUTER);
    add!("GAUSS_MIDDLE" = profile::GAUSS_MIDDLE);
    add!("MARKED" = holes::MARKED, "STROKED" = holes::STROKED, "CROSSING_PX" = holes::CROSSING_PX);
    add!(
        "TIP_SLACK" = tips::TIP_SLACK,
        "FRINGE_UNIT" = fringes::FRINGE_UNIT,
        "FACES_MAX" = holes::FACES_MAX,
        "HOLE_UNIT" = inset::HOLE_UNIT
    );
    add!("FRINGE_FAR_PX" = fringes::FRINGE_FAR_PX, "FRINGE_SLACK" = fringes::FRINGE_SLACK);
    add!("FRINGED_MAX" = fringes::FRINGED_MAX);
    add!("INSIDE" = inset::INSIDE, "NARROW_PX" = inset::NARROW_PX, "LEVEL_PX" = inset::LEVEL_PX);
    // Mixed pixels.
    add_same!("", kinds: BY_NORMAL BY_COLOR UNIQUE);
    add_same!("BREAKS_", breaks: OWN LEFT UPPER THIN HARD);
    add_same!("", thinness: ASPECT HEIGHT_MAX LENGTH_MIN LENGTH_MAX);
    add_same!("", thin: SLACK);
    add!("MIRROR_ROUGHNESS" = MIRROR_ROUGHNESS);
    add!(
        "ALIKE" = look::ALIKE,
        "SLIGHT" = look::SLIGHT,
        "MIRROR_SCALE" = look::MIRROR_SCALE,
        "NORMAL_SHIFT" = look::NORMAL_SHIFT
    );
    add!(
        "MATERIAL_VERTEX_NORMALS" = flags::VERTEX_NORMALS,
        "TEXTURE_NONE" = TEXTURE_NONE,
        "TEXTURE_SLOTS" = slots::COUNT
    );
    add!(
        "HEAD_WORDS" = MIXED_HEAD_BYTES / 4,
        "BORDER_WORDS" = POINTS / 32,
        "FIRSTS_WORDS" = POINTS / 32,
        "SETS_WORDS" = WORKGROUP as usize * POINTS / 32,
        "DIGIT_WORDS" = 8 * POINTS / 32,
        "PLACE_MAX" = points::PLACE_MAX,
        "FEW_STEP" = points::Lattice::<1>::STEP
    );
    add!("FEW_FIRST" = points::Lattice::<1>::FIRST, "EDGE_MAX" = triangle::EDGE_MAX);
    let of_all_levels = |places: u8| places | places << breaks::HARD;
    add!(
        "OWN_PLACES" = breaks::OWN << breaks::HARD,
        "LEFT_PLACES" = of_all_levels(breaks::LEFT) | breaks::OWN << breaks::HARD,
        "UPPER_PLACES" = of_all_levels(breaks::UPPER) | breaks::OWN << breaks::HARD,
        "HARD_PLACES" = (breaks::OWN | breaks::LEFT | breaks::UPPER | breaks::THIN) << breaks::HARD,
    );
    let outermost = |OutermostSamples { left, right, top, bottom }| left | right << 4 | top << 8 | bottom << 12;
    add!("FOUR_OUTERMOST" = outermost(OutermostSamples::OF_FOUR));
    add!("SIXTEEN_OUTERMOST" = outermost(OutermostSamples::OF_SIXTEEN));
    // Occlusion.
    add!("NOWHERE" = occlusion::grid::NOWHERE, "BIAS" = occlusion::gather::BIAS, "GAIN" = occlusion::gather::GAIN);
    add!("SHOULDER" = light::SHOULDER);
    add!("TAPS_PER_PIXEL" = TAPS_PER_PIXEL);
    // Sample offsets, a nibble each.
    let nibbles = |samples: u32, axis: usize, from: usize| {
        let offsets = sample_offsets(samples).iter().skip(from).take(8);
        (0..).zip(offsets).fold(0_u32, |word, (s, offset)| word | (offset[axis] as u32 >> 4) << (4 * s))
    };
    assert_eq!(nibbles(1, 0, 0), nibbles(1, 1, 0));
    add!("ONE_SAMPLE_XY" = nibbles(1, 0, 0), "FOUR_SAMPLES_X" = nibbles(4, 0, 0), "FOUR_SAMPLES_Y" = nibbles(4, 1, 0));
    add!("EIGHT_SAMPLES_X" = nibbles(8, 0, 0), "EIGHT_SAMPLES_Y" = nibbles(8, 1, 0));
    add!("SIXTEEN_SAMPLES_X_FIRST" = nibbles(16, 0, 0), "SIXTEEN_SAMPLES_X_LAST" = nibbles(16, 0, 8));
    add!("SIXTEEN_SAMPLES_Y_FIRST" = nibbles(16, 1, 0), "SIXTEEN_SAMPLES_Y_LAST" = nibbles(16, 1, 8));
    add!("SIXTEEN_SAMPLES_SHIFT" = sample_offsets(16)[0][0] & 15);
    all
}

/// Constants that only shaders have: the states of a search, places in their own buffers, what fits
/// their 32 bits.
const SHADER_ONLY: &[&str] = &[
    "TIP_BEHIND",
    "TIP_BESIDE",
    "TIP_INSIDE",
    "NEARER",
    "OTHER",
    "FIND_ALONG",
    "FIND_AROUND",
    "DRAW_ALL",
    "DRAW_RUNS",
    "DRAW_NOTHING",
    "BEYOND",
    "AREA_WORD",
    "COUNT_WORD",
    "CARRY_WORD",
    "MASK_WORD",
    "SLACK_WORD",
    "HOLE_WORD",
    "FEW",
    "OVERFLOW",
    "ITEM_COUNT",
    "PART_COUNT",
    "LIST_END",
    "LIST_MAX",
    "PARTS_OF_PIXEL",
    "WHOLE",
    "WHOLE_WORD",
    "FRESH",
    "STEP_NONE",
    "STEP_SLIGHT",
    "STEP_HARD",
];

#[test]
fn constants_of_shaders_and_rust_are_equal() {
    let shared = shared_constants();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for (kernel, module) in parsed() {
        for (_, constant) in module.constants.iter() {
            let Some(name) = &constant.name else { continue };
            *seen.entry(name.clone()).or_default() += 1;
            let naga::Expression::Literal(literal) = module.global_expressions[constant.init] else {
                panic!("{kernel:?}: {name} is no literal");
            };
            match (shared.get(name.as_str()), SHADER_ONLY.contains(&name.as_str())) {
                (Some(value), false) => assert_eq!(number(literal), *value, "{kernel:?}: {name}"),
                (None, true) => {}
                _ => panic!("{kernel:?}: list {name} once, in shared_constants or in SHADER_ONLY"),
            }
        }
    }
    for name in shared.keys().copied().chain(SHADER_ONLY.iter().copied()) {
        assert!(seen.contains_key(name), "no shader has {name}");
    }
    // A fan of a polygon with so many corners.
    assert_eq!(PIECES_MAX as usize, clip::CORNERS_MAX - 2);
}

fn number(literal: naga::Literal) -> f64 {
    match literal {
        naga::Literal::F32(v) => f64::from(v),
        naga::Literal::U32(v) => f64::from(v),
        naga::Literal::I32(v) => f64::from(v),
        other => panic!("{other:?}"),
    }
}

/// A struct's size, and its fields: name, offset, and whether it holds floating-point numbers.
struct Layout {
    size: usize,
    fields: Vec<(&'static str, usize, bool)>,
}

/// The layout of a struct, all of whose fields must be named.
macro_rules! layout {
    ($type:ident { $($field:ident)* }) => {{
        #[allow(dead_code)]
        fn names_all_fields($type { $($field: _),* }: &$type) {}
        fn is_float<T>(_: impl Fn(&$type) -> &T) -> bool {
            std::any::type_name::<T>().contains("f32")
        }
        let fields = vec![$((stringify!($field), offset_of!($type, $field), is_float(|v| &v.$field))),*];
        Layout { size: size_of::<$type>(), fields }
    }};
}

fn layouts() -> Vec<(&'static str, Layout)> {
    vec![
        (
            "Frame",
            layout!(Frame {
                x_row y_row z_row w_row screen_up screen_right to_viewer lamps halfways background background_step hull_color
                near_w ambient lamp_count zero width height triangle_count vertex_count masks_at material_count layer_fade
                hull_color_count image_count normal_triangles_at uv_triangles_at color_triangles_at
                occlusion_depth occlusion_spread taps occlusion_reach second_uvs_at vertices_at items_at pixels_at
                has_tints has_quarters padding_a
            }),
        ),
        (
            "Batch",
            layout!(Batch {
                first count faces row_first row_end capacity large_first large_end huge_first huge_end edges_per_group
                line_width line_smoothing line_flags line_exponent line_windows line_slices line_peak line_units
                line_pass seen_first seen_end samples_at pass_bit layer column_first column_end seen_margin
                alone_size groups_each cleared rgba_at slots_first slots_end list_capacity part_capacity tint_reach
                unseen_part farther_samples line_fade
            }),
        ),
        (
            "Material",
            layout!(ShadedMaterial {
                base_color emissive alpha_cutoff wire_color wire_thickness wire_smoothing metallic roughness
                normal_scale flags opacity facing_opacity occlusion_texture_strength padding_a padding_b padding_c
                textures
            }),
        ),
        ("Vertex", layout!(ScreenVertex { x y z inv_w })),
    ]
}

#[test]
fn structs_of_shaders_and_rust_are_equal_field_for_field() {
    let mut compared: BTreeMap<&str, usize> = BTreeMap::new();
    for (kernel, module) in parsed() {
        for (name, layout) in layouts() {
            let Some((members, span)) = members(&module, name) else { continue };
            assert_eq!(span as usize, layout.size, "{kernel:?}: size of {name}");
            let theirs: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
            let ours: Vec<_> = layout.fields.iter().map(|&(field, offset, _)| (field, offset)).collect();
            assert_eq!(theirs, ours, "{kernel:?}: {name}");
            for (member, (field, _, is_float)) in members.iter().zip(&layout.fields) {
                // A texture use is words of both kinds.
                assert!(*field == "textures" || is_of_floats(&module, member.ty) == *is_float, "{name}.{field}");
            }
            *compared.entry(name).or_default() += 1;
        }
    }
    assert_eq!(compared.keys().copied().collect::<Vec<_>>(), ["Batch", "Frame", "Material", "Vertex"]);
}

#[test]
fn buffers_of_the_shaders_have_the_sizes_that_are_reserved() {
    let mut compared = 0;
    for (kernel, module) in parsed() {
        if let Some((_, span)) = members(&module, "PeelState") {
            assert_eq!(u64::from(span), PEEL_STATE_BYTES, "{kernel:?}");
            compared += 1;
        }
        for name in ["Work", "WorkList"] {
            if let Some((members, _)) = members(&module, name) {
                assert_eq!(members.last().map(|m| u64::from(m.offset)), Some(WORK_HEAD_BYTES), "{kernel:?}");
                compared += 1;
            }
        }
        if let Some((members, _)) = members(&module, "Progress") {
            assert_eq!(members.last().map(|m| u64::from(m.offset)), Some(line_shares::PROGRESS_HEAD_BYTES));
            compared += 1;
        }
        if let Some((_, span)) = members(&module, "Paused") {
            assert_eq!(u64::from(span), line_shares::PAUSED_BYTES);
            compared += 1;
        }
    }
    assert!(compared > 15, "{compared}");
    // An edge is four words in the shaders.
    assert_eq!(size_of::<Edge>(), 16);
}

fn members<'a>(module: &'a naga::Module, name: &str) -> Option<(&'a [naga::StructMember], u32)> {
    module.types.iter().find_map(|(_, ty)| match &ty.inner {
        naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => Some((&members[..], *span)),
        _ => None,
    })
}

fn is_of_floats(module: &naga::Module, ty: naga::Handle<naga::Type>) -> bool {
    match &module.types[ty].inner {
        naga::TypeInner::Array { base, .. } => is_of_floats(module, *base),
        naga::TypeInner::Scalar(scalar) | naga::TypeInner::Vector { scalar, .. } => {
            scalar.kind == naga::ScalarKind::Float
        }
        other => panic!("{other:?}"),
    }
}
