//! The compute pipelines, made when a plan first needs them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::look;

/// A kernel, in one of its variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Vertices to the screen.
    Transform,
    /// Triangles to samples: small ones, and a list of the large ones.
    Visibility {
        /// How samples are written.
        write: Write,
        /// Where to.
        into: Into,
    },
    /// What is left of triangles behind the eye, to the same list.
    Clip,
    /// Large triangles to samples.
    VisibilityTile {
        /// As above.
        write: Write,
        /// As above.
        into: Into,
    },
    /// A layer's samples to colours, under those of the layers before it.
    Layers,
    /// Samples to colours.
    Shade,
    /// Edges to ink.
    Lines,
    /// Colours and ink to bytes.
    Resolve,
}

/// How a visibility kernel writes samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Write {
    /// Depth and id in one 64-bit maximum.
    Both,
    /// The maximum of the depths.
    Depth,
    /// The lowest id of those that have that depth.
    Id,
}

/// What a visibility kernel's samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Into {
    /// The visibility buffer.
    Surface,
    /// A layer.
    Layer,
}

/// Buffers by their binding number in group 1 of every shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Slot {
    Positions,
    HullNormals,
    Triangles,
    Vertices,
    Samples,
    Work,
    Normals,
    CornerTriangles,
    Attributes,
    Colors,
    Edges,
    Ink,
    InkTable,
    Thresholds,
    Rgba,
    Materials,
    FaceNormals,
    LineColors,
    Uvs,
    VertexColors,
    Texels,
    Roles = 24,
    HullLooks,
    Layer,
    Layered,
    Rounds,
    HullAmounts,
}

/// Number of [`Slot`]s.
pub const SLOTS: usize = 30;

/// Whether a kernel writes to a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read,
    ReadWrite,
}

/// A pipeline and the layout of its group 1.
pub struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    pub buffers: wgpu::BindGroupLayout,
}

/// All pipelines of a device so far.
#[derive(Default)]
pub struct Stages {
    made: Mutex<HashMap<(Stage, u32), Arc<Pipeline>>>,
}

impl Stages {
    /// The pipeline of a stage for a plan of this look.
    pub fn get(&self, device: &wgpu::Device, stage: Stage, look: u32) -> Arc<Pipeline> {
        let look = look & stage.looks();
        // Held while compiling: two workers that begin together want the same pipelines.
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.entry((stage, look)).or_insert_with(|| Arc::new(stage.compile(device, look))).clone()
    }

    /// Forgets all pipelines; jobs that use one keep it until they are done.
    pub fn clear(&self) {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

/// The layout of group 0: the plan's numbers, and at a dynamic offset the dispatch's.
pub fn uniforms_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, has_dynamic_offset| {
        layout_entry(
            binding,
            wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset,
                min_binding_size: None,
            },
        )
    };
    let entries = [entry(0, false), entry(1, true)];
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("uniforms"), entries: &entries })
}

fn layout_entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

const COMMON: &str = include_str!("../../../shaders/common.wgsl");
const PLANES: &str = include_str!("../../../shaders/planes.wgsl");
const WORK: &str = include_str!("../../../shaders/work.wgsl");
const TRIANGLE: &str = include_str!("../../../shaders/triangle.wgsl");
const SAMPLES_32: &str = include_str!("../../../shaders/samples32.wgsl");
const SAMPLES_64: &str = include_str!("../../../shaders/samples64.wgsl");
const SAMPLES: &str = include_str!("../../../shaders/samples.wgsl");
const LAYERED: &str = include_str!("../../../shaders/layered.wgsl");
const EMIT: &str = include_str!("../../../shaders/emit.wgsl");
const EMIT_LAYER: &str = include_str!("../../../shaders/emit_layer.wgsl");
const GROUP: &str = include_str!("../../../shaders/group.wgsl");

/// What shade and layers have in common: from where a point lies to its colour.
const SHADE: &[&str] = &[
    include_str!("../../../shaders/barycentric.wgsl"),
    include_str!("../../../shaders/texture.wgsl"),
    include_str!("../../../shaders/light.wgsl"),
    include_str!("../../../shaders/wire.wgsl"),
    include_str!("../../../shaders/debug.wgsl"),
    include_str!("../../../shaders/point.wgsl"),
    GROUP,
    LAYERED,
];

impl Stage {
    /// The buffers of group 1 that the kernel declares.
    pub fn buffers(self) -> &'static [(Slot, Access)] {
        use Access::{Read, ReadWrite};
        match self {
            Self::Transform => &[
                (Slot::Positions, Read),
                (Slot::HullNormals, Read),
                (Slot::HullAmounts, Read),
                (Slot::Vertices, ReadWrite),
            ],
            Self::Visibility { into: Into::Surface, .. } => &[
                (Slot::Triangles, Read),
                (Slot::Roles, Read),
                (Slot::Vertices, Read),
                (Slot::Samples, ReadWrite),
                (Slot::Work, ReadWrite),
                (Slot::Rounds, Read),
            ],
            Self::Visibility { into: Into::Layer, .. } => &[
                (Slot::Triangles, Read),
                (Slot::Roles, Read),
                (Slot::Vertices, Read),
                (Slot::Samples, ReadWrite),
                (Slot::Work, ReadWrite),
                (Slot::Rounds, Read),
                (Slot::Layer, Read),
                (Slot::Layered, Read),
            ],
            Self::Clip => &[
                (Slot::Positions, Read),
                (Slot::HullNormals, Read),
                (Slot::HullAmounts, Read),
                (Slot::Triangles, Read),
                (Slot::Roles, Read),
                (Slot::Vertices, Read),
                (Slot::Work, ReadWrite),
                (Slot::Rounds, Read),
            ],
            Self::VisibilityTile { into: Into::Surface, .. } => &[(Slot::Samples, ReadWrite), (Slot::Work, Read)],
            Self::VisibilityTile { into: Into::Layer, .. } => {
                &[(Slot::Samples, ReadWrite), (Slot::Work, Read), (Slot::Layer, Read), (Slot::Layered, Read)]
            }
            Self::Layers => &[
                (Slot::Positions, Read),
                (Slot::Triangles, Read),
                (Slot::Vertices, Read),
                (Slot::Normals, Read),
                (Slot::CornerTriangles, Read),
                (Slot::Attributes, Read),
                (Slot::Materials, Read),
                (Slot::FaceNormals, Read),
                (Slot::Uvs, Read),
                (Slot::VertexColors, Read),
                (Slot::Texels, Read),
                (Slot::Roles, Read),
                (Slot::HullLooks, Read),
                (Slot::Layer, Read),
                (Slot::Layered, ReadWrite),
                (Slot::Rounds, ReadWrite),
            ],
            Self::Shade => &[
                (Slot::Positions, Read),
                (Slot::Triangles, Read),
                (Slot::Vertices, Read),
                (Slot::Samples, Read),
                (Slot::Normals, Read),
                (Slot::CornerTriangles, Read),
                (Slot::Attributes, Read),
                (Slot::Materials, Read),
                (Slot::FaceNormals, Read),
                (Slot::Roles, Read),
                (Slot::HullLooks, Read),
                (Slot::Layered, Read),
                (Slot::Uvs, Read),
                (Slot::VertexColors, Read),
                (Slot::Texels, Read),
                (Slot::Colors, ReadWrite),
            ],
            Self::Lines => &[
                (Slot::Positions, Read),
                (Slot::Triangles, Read),
                (Slot::Vertices, Read),
                (Slot::Samples, Read),
                (Slot::Edges, Read),
                (Slot::Ink, ReadWrite),
                (Slot::InkTable, Read),
            ],
            Self::Resolve => &[
                (Slot::Colors, Read),
                (Slot::Ink, Read),
                (Slot::Thresholds, Read),
                (Slot::Rgba, ReadWrite),
                (Slot::LineColors, Read),
            ],
        }
    }

    /// The buffer that is bound at a slot's number: a kernel that looks for a layer writes it where others write samples, and
    /// reads these where others find layers.
    pub fn bound_at(self, slot: Slot) -> Slot {
        match (self, slot) {
            (Self::Visibility { into: Into::Layer, .. } | Self::VisibilityTile { into: Into::Layer, .. }, slot) => {
                match slot {
                    Slot::Samples => Slot::Layer,
                    Slot::Layer => Slot::Samples,
                    slot => slot,
                }
            }
            _ => slot,
        }
    }

    /// Name of the entry point, and of the file in shaders/.
    fn entry(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Visibility { .. } => "visibility",
            Self::Clip => "clip",
            Self::Layers => "layers",
            Self::VisibilityTile { .. } => "visibility_tile",
            Self::Shade => "shade",
            Self::Lines => "lines",
            Self::Resolve => "resolve",
        }
    }

    /// WGSL has no include: a kernel is its files, one after the other.
    fn source(self) -> String {
        let keep_nearest = |write: Write| if write == Write::Both { SAMPLES_64 } else { SAMPLES_32 };
        let emit = |into: Into| match into {
            Into::Surface => EMIT.to_owned(),
            Into::Layer => [LAYERED, EMIT_LAYER].concat(),
        };
        match self {
            Self::Transform => [COMMON, include_str!("../../../shaders/transform.wgsl")].concat(),
            Self::Visibility { write, into } => {
                let kernel = include_str!("../../../shaders/visibility.wgsl");
                [COMMON, TRIANGLE, WORK, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Clip => [COMMON, TRIANGLE, WORK, PLANES, include_str!("../../../shaders/clip.wgsl")].concat(),
            Self::VisibilityTile { write, into } => {
                let kernel = include_str!("../../../shaders/visibility_tile.wgsl");
                [COMMON, TRIANGLE, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Layers => {
                [&[COMMON, TRIANGLE], SHADE, &[include_str!("../../../shaders/layers.wgsl")]].concat().concat()
            }
            Self::Shade => {
                [&[COMMON, TRIANGLE], SHADE, &[include_str!("../../../shaders/shade.wgsl")]].concat().concat()
            }
            Self::Lines => [COMMON, TRIANGLE, PLANES, include_str!("../../../shaders/lines.wgsl")].concat(),
            Self::Resolve => [COMMON, include_str!("../../../shaders/resolve.wgsl")].concat(),
        }
    }

    /// The flags that the kernel reads; there is a pipeline for every combination that a plan asks for.
    fn looks(self) -> u32 {
        const NORMALS: u32 = look::FACE_NORMALS | look::VERTEX_NORMALS | look::DERIVATIVE_NORMALS;
        const WIRES: u32 = look::WIRES | look::WIRE_MINIMUM | look::WIRE_LIT | look::EDGE_MASKS;
        const PAINT: u32 = look::VERTEX_COLORS | look::UVS | look::TEXTURES | look::DEBUG | look::VARYING;
        const SHADED: u32 = look::SURFACE
            | look::TRIANGLE_MATERIALS
            | NORMALS
            | WIRES
            | PAINT
            | look::CLIPPED
            | look::FOUR_SAMPLES
            | look::HULL_LOOKS
            | look::WIRES_ONLY;
        match self {
            Self::Transform => look::HULL_PX | look::HULL_AMOUNTS,
            Self::Clip => look::HULL_PX | look::HULL_AMOUNTS | look::ROLES | look::LAYERS,
            Self::Visibility { into: Into::Surface, .. } => look::FOUR_SAMPLES | look::ROLES,
            Self::Visibility { into: Into::Layer, .. } => {
                look::FOUR_SAMPLES | look::ROLES | look::LAYERS | look::BEHIND_SURFACE
            }
            Self::VisibilityTile { into: Into::Surface, .. } => look::FOUR_SAMPLES,
            Self::VisibilityTile { into: Into::Layer, .. } => look::FOUR_SAMPLES | look::BEHIND_SURFACE,
            Self::Layers => SHADED | look::LAYERED_HULL,
            Self::Shade => SHADED | look::LAYERS,
            Self::Lines => look::CLIPPED | look::FOUR_SAMPLES,
            Self::Resolve => look::SURFACE | look::HULL | look::LINES,
        }
    }

    /// Values of the kernel's `override` constants.
    fn constants(self, look: u32) -> Vec<(&'static str, f64)> {
        let look = ("LOOK", f64::from(look));
        match self {
            Self::Visibility { write: Write::Depth, .. } | Self::VisibilityTile { write: Write::Depth, .. } => {
                vec![look, ("PHASE", 0.0)]
            }
            Self::Visibility { write: Write::Id, .. } | Self::VisibilityTile { write: Write::Id, .. } => {
                vec![look, ("PHASE", 1.0)]
            }
            _ => vec![look],
        }
    }

    fn compile(self, device: &wgpu::Device, look: u32) -> Pipeline {
        let label = Some(self.entry());
        let source = wgpu::ShaderSource::Wgsl(self.source().into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        let entries: Vec<_> = self.buffers().iter().map(|&(slot, access)| buffer_entry(slot, access)).collect();
        let buffers = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&uniforms_layout(device)), Some(&buffers)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&layout),
            module: &module,
            entry_point: label,
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &self.constants(look),
                // The kernels write their workgroup memory before they read it.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        Pipeline { pipeline, buffers }
    }
}

fn buffer_entry(slot: Slot, access: Access) -> wgpu::BindGroupLayoutEntry {
    layout_entry(
        slot as u32,
        wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: access == Access::Read },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
    )
}
