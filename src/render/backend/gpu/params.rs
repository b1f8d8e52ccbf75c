//! The parameters of kernels in the layout in which shaders read them: `Frame`, the uniforms of a picture, and
//! `Batch`, those of a dispatch, field for field as in shaders/common.wgsl.
//!
//! Also the tables that are made for the upload of a plan: sizes and places of textures, triangles' materials and edge
//! masks, colours and materials of the outline mesh, index arrays, lists of edges, colours of lines, and for each
//! sample a mask of those of the pixel's 256 coverage points that count for it (stage lines).

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::backend::sample_partition::{POINTS, sample_partition};
use crate::plan::{
    DrawPlan, Edge, Faces, HullPass, Lights, LineFade, LinePass, OcclusionPass, SurfacePass, TAPS, Texture, Textures,
};

/// Uniforms of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Frame {
    pub x_row: [f32; 4],
    pub y_row: [f32; 4],
    pub z_row: [f32; 4],
    pub w_row: [f32; 4],
    pub screen_up: [f32; 4],
    pub screen_right: [f32; 4],
    pub to_viewer: [f32; 4],
    pub lamps: [[f32; 4]; Lights::LAMPS_MAX],
    pub halfways: [[f32; 4]; Lights::LAMPS_MAX],
    pub background: [f32; 4],
    pub background_step: [f32; 4],
    pub hull_color: [f32; 4],
    pub near_w: f32,
    pub ambient: f32,
    pub lamp_count: u32,
    pub zero: u32,
    pub width: u32,
    pub height: u32,
    pub triangle_count: u32,
    pub vertex_count: u32,
    pub masks_at: u32,
    pub material_count: u32,
    pub layer_fade: f32,
    pub hull_color_count: u32,
    pub image_count: u32,
    pub normal_triangles_at: u32,
    pub uv_triangles_at: u32,
    pub color_triangles_at: u32,
    pub occlusion_depth: [f32; 4],
    pub occlusion_spread: [f32; 4],
    pub taps: [[u32; 4]; TAPS / 4],
    pub occlusion_reach: f32,
    pub second_uvs_at: u32,
    pub vertices_at: u32,
    pub items_at: u32,
    pub pixels_at: u32,
    pub has_tints: u32,
    pub has_quarters: u32,
    pub padding_a: u32,
}

/// An image as shaders/surface/texture.wgsl reads it: four vectors of two words.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TextureEntry {
    pub width: u32,
    pub height: u32,
    pub first_level: u32,
    pub levels: u32,
    /// Place of its first texel among those of all images.
    pub first_texel: u32,
    pub padding: [u32; 3],
}

/// The images of a picture, whose texels follow one another.
pub fn texture_table(textures: &Textures) -> Vec<TextureEntry> {
    let mut first_texel = 0;
    let entry = |image: &Texture| {
        let &Texture { width, height, first_level, levels, .. } = image;
        let entry = TextureEntry { width, height, first_level, levels, first_texel, padding: [0; 3] };
        first_texel += image.texels.len() as u32;
        entry
    };
    textures.images.iter().map(entry).collect()
}

/// Uniforms of a dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Batch {
    pub first: u32,
    pub count: u32,
    pub faces: u32,
    pub row_first: i32,
    pub row_end: i32,
    pub capacity: u32,
    pub large_first: u32,
    pub large_end: u32,
    pub huge_first: u32,
    pub huge_end: u32,
    pub edges_per_group: u32,
    pub line_width: f32,
    pub line_smoothing: f32,
    pub line_flags: u32,
    pub line_exponent: u32,
    pub line_windows: f32,
    pub line_slices: u32,
    pub line_peak: f32,
    pub line_units: u32,
    pub line_pass: u32,
    pub seen_first: i32,
    pub seen_end: i32,
    pub samples_at: u32,
    pub pass_bit: u32,
    pub layer: u32,
    pub column_first: i32,
    pub column_end: i32,
    pub seen_margin: i32,
    pub alone_size: i32,
    pub groups_each: u32,
    pub cleared: u32,
    pub rgba_at: u32,
    pub slots_first: u32,
    pub slots_end: u32,
    pub list_capacity: u32,
    pub part_capacity: u32,
    pub tint_reach: f32,
    pub unseen_part: f32,
    pub farther_samples: u32,
    pub line_fade: u32,
}

/// Bits of [`Batch::line_flags`].
pub mod line_flags {
    use crate::plan::{DrawPlan, FaceSide, LinePass, Shown};

    /// Strokes are those of the parts that nothing hides.
    pub const SHOWN_VISIBLE: u32 = 1;
    /// Hidden parts are drawn too, fainter. Without [`SHOWN_VISIBLE`], strokes are those of whole edges, and the kernel
    /// coverage keeps the share that they cover.
    pub const FADES_HIDDEN: u32 = 2;
    /// Edges whose faces all face away are left out.
    pub const SKIP_BACK: u32 = 4;
    /// The pass draws silhouettes alone.
    pub const CONTOUR: u32 = 8;
    /// The surface's light falls on the lines.
    pub const LIT_PASS: u32 = 16;
    /// No pass has composited anything over the background yet.
    pub const FIRST_PASS: u32 = 32;
    /// The surface is inside out: the fronts of faces face away.
    pub const INSIDE_OUT: u32 = 64;
    /// Only pixels that are marked get strokes; elsewhere holes tell what lines cover.
    pub const HOLES: u32 = 128;
    /// Rims alone are drawn, and the pixels that they reach marked.
    pub const RIM_PASS: u32 = 256;
    /// Layers tint the lines.
    pub const TINTED_PASS: u32 = 512;
    /// Edges name all of their faces.
    pub const NAMES_ALL_FACES: u32 = 1024;
    /// Edges between two faces with fringes are left out, unless they are silhouettes.
    pub const FRINGES: u32 = 2048;

    /// The bits of a pass; [`FIRST_PASS`], [`HOLES`], [`RIM_PASS`] and [`FRINGES`] aside.
    pub fn of(plan: &DrawPlan<'_>, lines: &LinePass, something_hides: bool) -> u32 {
        let when = |condition: bool, flag: u32| if condition { flag } else { 0 };
        // Without a surface nothing hides a line, and there is no visibility buffer to read.
        let shown = match lines.shown {
            Shown::All => 0,
            _ if !something_hides => 0,
            Shown::Visible => SHOWN_VISIBLE,
            Shown::Faded => SHOWN_VISIBLE | FADES_HIDDEN,
        };
        shown
            | when(lines.unseen_side.is_some(), SKIP_BACK)
            | when(lines.contour, CONTOUR)
            | when(lines.lit && plan.lights_lines(), LIT_PASS)
            | when(lines.unseen_side == Some(FaceSide::Front), INSIDE_OUT)
            | when(plan.tints(lines), TINTED_PASS)
            | when(plan.names_all_faces, NAMES_ALL_FACES)
    }
}

// A gang has an array of them in its uniforms.
const _: () = assert!(size_of::<Batch>().is_multiple_of(16));

/// Distance between [`Batch`]es in their buffer: every device can bind at multiples of this.
pub const BATCH_STRIDE: usize = 256;

impl Frame {
    /// The uniforms of a plan.
    pub fn new(plan: &DrawPlan<'_>) -> Self {
        let p = &plan.projection;
        let mut frame = Self {
            x_row: p.x,
            y_row: p.y,
            z_row: p.z,
            w_row: p.w,
            near_w: p.near_w,
            screen_up: xyz(p.screen_up),
            screen_right: xyz(p.screen_right),
            to_viewer: [p.to_viewer[0], p.to_viewer[1], p.to_viewer[2], p.ray_slope()],
            background: plan.background,
            background_step: plan.background_step,
            width: plan.width_px,
            height: plan.height_px,
            triangle_count: plan.triangles.len() as u32,
            ..Self::default()
        };
        if let Some(surface) = &plan.surface {
            frame.surface(surface, &plan.triangles);
        }
        if let Some(pass) = &plan.occlusion {
            frame.occlusion(pass);
        }
        if let Some(hull) = &plan.hull {
            frame.hull_color = hull.color(0);
            frame.hull_color_count = hull.colors.len() as u32;
        }
        frame.has_tints = u32::from(plan.tints_lines());
        frame.has_quarters = u32::from(plan.has_quarters());
        frame.layer_fade = plan.peeling().map_or(1.0, |layers| layers.fade);
        frame
    }

    fn occlusion(&mut self, pass: &OcclusionPass) {
        let [a, b, c] = pass.depth;
        self.occlusion_depth = [a, b, c, pass.strength];
        self.occlusion_spread = [pass.spread[0], pass.spread[1], pass.near, pass.near_depth];
        self.occlusion_reach = pass.inverse_square();
        for (at, [across, down]) in pass.taps.iter().enumerate() {
            self.taps[at / 4][at % 4] = (across & 0xFFFF) as u32 | (down << 16) as u32;
        }
    }

    fn surface(&mut self, surface: &SurfacePass<'_>, triangles: &[[u32; 3]]) {
        for (i, lamp) in surface.lights.lamps.iter().take(Lights::LAMPS_MAX).enumerate() {
            let [x, y, z] = lamp.to_light;
            self.lamps[i] = [x, y, z, lamp.strength];
            self.halfways[i] = xyz(lamp.halfway);
            self.lamp_count += 1;
        }
        self.ambient = surface.lights.ambient;
        self.material_count = surface.materials.len() as u32;
        self.masks_at = surface.triangle_materials.len() as u32;
        self.image_count = surface.textures.images.len() as u32;
        self.second_uvs_at = surface.uvs.as_ref().map_or(0, |uvs| uvs.values.len() as u32);
        let (_, [normals, uvs, colors]) = corner_triangles(surface, triangles);
        (self.normal_triangles_at, self.uv_triangles_at, self.color_triangles_at) = (normals, uvs, colors);
    }
}

/// The hull's colours, then the materials of the mesh's triangles and of its own: what
/// [`Frame::hull_color_count`] points into.
pub fn hull_materials(hull: &HullPass<'_>) -> Vec<u8> {
    let materials = [&hull.surface_materials[..], &hull.triangle_materials].map(bytemuck::cast_slice::<u32, u8>);
    [bytemuck::cast_slice(&hull.colors), materials[0], materials[1]].concat()
}

/// Triangles' materials, then edge masks four to a word: what [`Frame::masks_at`] points into.
pub fn attributes(surface: &SurfacePass<'_>) -> Vec<u8> {
    [bytemuck::cast_slice(&surface.triangle_materials), &surface.edge_masks[..]].concat()
}

/// Value of `normal_triangles_at` for normals indexed by the plan's own triangles, which are on the
/// GPU already.
pub const OWN_TRIANGLES: u32 = u32::MAX;

/// The index arrays of normals, texture coordinates and colours, each once, and where each of the
/// three begins when they lie one after the other.
///
/// A mesh's normals go by position (`own`, the plan's triangles) or by what the other two go by:
/// one array is all there is.
pub fn corner_triangles<'a>(surface: &'a SurfacePass<'_>, own: &[[u32; 3]]) -> (Vec<&'a [[u32; 3]]>, [u32; 3]) {
    let normals = surface.vertex_normals.as_ref().map(|v| &v.triangles[..]);
    let has_own = normals.is_some_and(|triangles| std::ptr::eq(triangles, own));
    let of = [
        normals.filter(|_| !has_own),
        surface.uvs.as_ref().map(|v| &v.triangles[..]),
        surface.colors.as_ref().map(|v| &v.triangles[..]),
    ];
    let mut parts: Vec<&[[u32; 3]]> = Vec::new();
    let [normals, uvs, colors] = of.map(|triangles| {
        let Some(triangles) = triangles else { return 0 };
        let at = parts.iter().position(|part| std::ptr::eq(*part, triangles)).unwrap_or_else(|| {
            parts.push(triangles);
            parts.len() - 1
        });
        parts[..at].iter().map(|part| 3 * part.len() as u32).sum()
    });
    (parts, [if has_own { OWN_TRIANGLES } else { normals }, uvs, colors])
}

/// The lists of edges of line passes, each once, and where each pass's begins when they lie one
/// after the other.
pub fn edge_lists(passes: &[LinePass]) -> (Vec<&[Edge]>, Vec<u32>) {
    let mut lists: Vec<(&Arc<Vec<Edge>>, u32)> = Vec::new();
    let mut next = 0_u32;
    let starts = passes.iter().map(|LinePass { edges, .. }| {
        if let Some((_, start)) = lists.iter().find(|(list, _)| Arc::ptr_eq(list, edges)) {
            return *start;
        }
        lists.push((edges, next));
        // Saturates: no device has room for so many edges.
        let start = next;
        next = start.saturating_add(edges.len() as u32);
        start
    });
    let starts = starts.collect();
    (lists.into_iter().map(|(list, _)| &list[..]).collect(), starts)
}

/// The colours of line passes, and after them the opacities of those that fade: a head, which is the share of the
/// distance between two points of the grid that a pixel takes and the number of points per row, and then four opacities
/// per vector. [`fade_places`] says where each head is.
pub fn line_colors(passes: &[LinePass]) -> Vec<[f32; 4]> {
    let mut vectors: Vec<[f32; 4]> = passes.iter().map(|lines| lines.color).collect();
    for fade in passes.iter().filter_map(|lines| lines.fade.as_deref()) {
        vectors.push([1.0 / fade.spacing_px as f32, fade.columns as f32, 0.0, 0.0]);
        let four = |four: &[f32]| std::array::from_fn(|k| four.get(k).copied().unwrap_or(1.0));
        vectors.extend(fade.opacities.chunks(4).map(four));
    }
    vectors
}

/// The place of the opacities of each line pass in [`line_colors`]; 0 for a pass that does not fade.
pub fn fade_places(passes: &[LinePass]) -> Vec<u32> {
    let mut next = passes.len();
    let place = |fade: Option<&LineFade>| {
        let Some(fade) = fade else { return 0 };
        let place = next as u32;
        next += 1 + fade.opacities.len().div_ceil(4);
        place
    };
    passes.iter().map(|lines| lines.fade.as_deref()).map(place).collect()
}

/// The points assigned to each of a pixel's samples, eight words per sample, numbered as
/// shaders/lines/stroke.wgsl numbers them.
pub fn sample_masks(samples: u32) -> Vec<u32> {
    let mut masks = vec![0; samples as usize * POINTS / 32];
    for (point, &cell) in sample_partition(samples).iter().enumerate() {
        let (word, bit) = (point % 16, point / 16);
        masks[usize::from(cell) * (POINTS / 32) + word / 2] |= 1 << (bit + 16 * (word % 2));
    }
    masks
}

fn xyz(v: [f32; 3]) -> [f32; 4] {
    [v[0], v[1], v[2], 0.0]
}

/// Values of [`Batch::faces`].
pub const FACES_BOTH: u32 = 0;
/// As above.
pub const FACES_FRONT: u32 = 1;
/// As above.
pub const FACES_BACK: u32 = 2;

/// The shaders' value for a choice of faces.
pub fn faces_code(faces: Faces) -> u32 {
    match faces {
        Faces::Both => FACES_BOTH,
        Faces::Front => FACES_FRONT,
        Faces::Back => FACES_BACK,
    }
}

/// The batches, each at a multiple of [`BATCH_STRIDE`].
pub fn pack(batches: &[Batch]) -> Vec<u8> {
    let mut bytes = vec![0; batches.len() * BATCH_STRIDE];
    for (batch, slot) in batches.iter().zip(bytes.chunks_exact_mut(BATCH_STRIDE)) {
        slot[..size_of::<Batch>()].copy_from_slice(bytemuck::bytes_of(batch));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::schedule::test_plans::{edges, lines};
    use crate::plan::{CornerValues, Shown};

    #[test]
    fn each_point_belongs_to_one_sample() {
        for samples in [1, 4, 8, 16] {
            let masks = sample_masks(samples);
            assert_eq!(masks.len(), samples as usize * 8);
            for w in 0..8 {
                let words = masks.iter().skip(w).step_by(8);
                assert_eq!(words.clone().fold(0, |all, word| all | word), u32::MAX, "{samples}, word {w}");
                assert_eq!(words.map(|word| word.count_ones()).sum::<u32>(), 32, "{samples}, word {w}");
            }
        }
    }

    #[test]
    fn a_list_of_edges_is_uploaded_once() {
        let (long, short) = (edges(5), edges(3));
        let passes = [&long, &short, &long, &edges(3), &short].map(|list| lines(list.clone(), 1.0, Shown::All));
        let (lists, starts) = edge_lists(&passes);
        assert_eq!(lists.iter().map(|list| list.len()).collect::<Vec<_>>(), [5, 3, 3]);
        assert_eq!(starts, [0, 5, 0, 8, 5]);
    }

    #[test]
    fn opacities_follow_the_colours_of_all_passes() {
        let list = edges(1);
        let mut passes = [0.25_f32, 0.5, 0.75].map(|red| {
            let pass = lines(list.clone(), 1.0, Shown::All);
            LinePass { color: [red, 0.0, 0.0, 1.0], ..pass }
        });
        assert_eq!((line_colors(&passes).len(), fade_places(&passes)), (3, vec![0; 3]));
        let fade = |first: f32| {
            let opacities = (0..6).map(|i| first + i as f32 / 16.0).collect();
            Some(Arc::new(LineFade { spacing_px: 16, columns: 3, opacities }))
        };
        (passes[0].fade, passes[2].fade) = (fade(0.0), fade(0.5));
        let (vectors, places) = (line_colors(&passes), fade_places(&passes));
        assert_eq!(places, [3, 0, 6]);
        assert_eq!(vectors[..3], passes.each_ref().map(|pass| pass.color));
        for (place, first) in [(3, 0.0), (6, 0.5)] {
            assert_eq!(vectors[place], [1.0 / 16.0, 3.0, 0.0, 0.0]);
            assert_eq!(vectors[place + 1], [0.0, 1.0, 2.0, 3.0].map(|i| first + i / 16.0));
            assert_eq!(vectors[place + 2], [first + 4.0 / 16.0, first + 5.0 / 16.0, 1.0, 1.0]);
        }
        assert_eq!(vectors.len(), 9);
    }

    #[test]
    fn an_index_of_corners_is_uploaded_once_and_the_plans_own_never() {
        let (own, other) = (vec![[0, 1, 2]; 4], vec![[0, 1, 2]; 4]);
        fn values(triangles: &[[u32; 3]]) -> CornerValues<'_, [f32; 3]> {
            CornerValues { values: vec![[0.0; 3]; 3].into(), triangles: triangles.into() }
        }
        let mut surface = SurfacePass::new(Faces::Both, Vec::new());
        surface.uvs = Some(CornerValues { values: vec![[0.0; 2]; 3].into(), triangles: (&other).into() });
        surface.vertex_normals = Some(values(&own));
        assert_eq!(corner_triangles(&surface, &own), (vec![&other[..]], [OWN_TRIANGLES, 0, 0]));
        surface.vertex_normals = Some(values(&other));
        assert_eq!(corner_triangles(&surface, &own), (vec![&other[..]], [0, 0, 0]));
        surface.uvs = None;
        surface.colors = Some(CornerValues { values: vec![[0.0; 4]; 3].into(), triangles: (&own).into() });
        assert_eq!(corner_triangles(&surface, &own), (vec![&other[..], &own[..]], [0, 0, 12]));
    }
}
