//! The compute pipelines of a GPU: kernels (compute shaders) compiled for the features that a
//! picture has. A pipeline is made when it is first asked for, and kept for the pictures that follow.
//!
//! Also the list of all kernels, and that of the buffers with their binding numbers.

pub(crate) mod file;
pub(crate) mod kernels;
pub(crate) mod key;
pub(crate) mod prune;
pub(crate) mod reflection;
pub(crate) mod shaders;
#[cfg(test)]
pub(crate) mod tests;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use bytemuck::CheckedBitPattern;

use self::file::PipelineFile;
use self::reflection::Reflection;
use super::handles::Handles;
use crate::backend::DrawStage;

/// A kernel, in one of its variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Vertices to the screen.
    Transform,
    /// Triangles to samples: small ones, and a list of the large ones.
    Visibility {
        /// Phase of writing samples.
        write: SampleWrite,
        /// Buffer that is written.
        target: SampleTarget,
    },
    /// Clipped triangles to the same list.
    Clip,
    /// Large triangles to samples.
    VisibilityTile {
        /// As above.
        write: SampleWrite,
        /// As above.
        target: SampleTarget,
    },
    /// Samples to places for the occlusion stage.
    Grid,
    /// Places to the light that hollows go without.
    Gather,
    /// Few triangles to samples, whatever their size.
    VisibilityFew {
        /// Phase of writing samples.
        write: SampleWrite,
    },
    /// Samples of a peeled layer to colours, under the layers in front of it.
    Composite,
    /// Samples to colours.
    Shade,
    /// Samples to the places where colours break off.
    Breaks,
    /// Triangles to the pixels that show them, though no sample need see them.
    Thin,
    /// Those places to mixed pixels.
    MixedPixels,
    /// Points of mixed pixels to colours.
    MixedColor,
    /// Lists of mixed pixels to the parts of their colours.
    MixedParts,
    /// Those parts to colours.
    MixedShade,
    /// Parts of mixed pixels to their sums.
    MixedSum,
    /// Samples to bytes, where nothing else is to be drawn.
    Paint,
    /// Faces to the area that their lines leave free.
    Holes,
    /// Triangles to the pixels around their tips.
    Tips,
    /// Triangles to the points of their fringes.
    Fringes,
    /// Edges to strokes.
    Edge,
    /// Unites the strokes of a line pass in each pixel and composites them over the colours.
    Coverage,
    /// Samples to the light on a line pass.
    LineLight,
    /// Colours to bytes.
    Resolve,
}

/// Phase of a visibility kernel: with 64-bit atomics one, otherwise two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SampleWrite {
    /// Depth and id in one 64-bit maximum.
    Both,
    /// The maximum of the depths.
    Depth,
    /// The lowest id of those that have that depth.
    Id,
}

/// Buffer that a visibility kernel writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SampleTarget {
    /// The visibility buffer.
    Visibility,
    /// A peeled layer.
    Layer,
    /// The points of mixed pixels.
    Points,
    /// The lists of mixed pixels.
    Lists,
}

/// Buffers by their binding number in group 1 of every shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, CheckedBitPattern)]
#[repr(u32)]
pub enum Slot {
    Positions,
    Triangles = 2,
    Vertices,
    Samples,
    Work,
    Normals,
    CornerTriangles,
    Attributes,
    Colors,
    Edges,
    Owners,
    Strokes,
    Thresholds,
    Rgba,
    Materials,
    FaceNormals,
    LineColors,
    Uvs,
    VertexColors,
    Texels,
    Progress,
    Mixed,
    Points,
    PassMasks,
    HullMaterials,
    PeelLayer,
    PeelState,
    PeelRounds,
    SampleMasks,
    Occlusion,
    Lists,
}

/// Number of [`Slot`]s.
pub const SLOTS: usize = 32;

/// A kernel's access to a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read,
    ReadWrite,
}

/// A pipeline, and the buffers of its group 1 with their layout.
pub struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    pub slots: Vec<Slot>,
    pub buffers: wgpu::BindGroupLayout,
}

/// Things by key, each made by the first thread that needs it.
type MadeOnce<K, T> = Mutex<HashMap<K, Arc<OnceLock<T>>>>;

/// All pipelines of a device so far. Threads that need the same one make it once; different ones are
/// made side by side.
#[derive(Default)]
pub struct Pipelines {
    made: MadeOnce<(Kernel, u32), Arc<Pipeline>>,
    /// Bits of the key that a kernel depends on, by kernel and by whether gangs share it.
    key_bits: MadeOnce<(Kernel, bool), u32>,
    /// The driver's own form of the pipelines, kept on disk.
    file: Option<PipelineFile>,
}

impl Pipelines {
    /// None so far; what the driver makes of them is kept in `file`.
    pub fn kept_in(file: Option<PipelineFile>) -> Self {
        Self { file, ..Self::default() }
    }

    /// The pipeline of a kernel for a plan with this key.
    pub fn get(&self, gpu: &Handles, kernel: Kernel, key: u32) -> Arc<Pipeline> {
        let key = self.key_of(kernel, key);
        made_once(&self.made, (kernel, key), || {
            let pipeline = Arc::new(kernel.compile(gpu, key, self.file.as_ref().map(PipelineFile::cache)));
            tracing::debug!(?kernel, key, "made a pipeline");
            pipeline
        })
    }

    /// Those of the kernels that have no pipeline for this key yet.
    pub fn missing(&self, kernels: &[Kernel], key: u32) -> Vec<Kernel> {
        let is_made = |kernel: &Kernel| {
            let key = self.key_of(*kernel, key);
            let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
            made.get(&(*kernel, key)).is_some_and(|p| p.get().is_some())
        };
        kernels.iter().copied().filter(|kernel| !is_made(kernel)).collect()
    }

    /// Writes the driver's form of all pipelines to disk.
    pub fn save(&self) {
        if let Some(file) = &self.file {
            file.save();
        }
    }

    /// Drops all pipelines; jobs that use one keep it until they end.
    pub fn clear(&self) {
        self.made.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// The bits of a plan's key that a kernel depends on.
    fn key_of(&self, kernel: Kernel, key: u32) -> u32 {
        let is_of_gang = key & key::GANG != 0;
        key & made_once(&self.key_bits, (kernel, is_of_gang), || kernel.key_bits(is_of_gang))
    }
}

fn made_once<K: Eq + Hash, T: Clone>(things: &MadeOnce<K, T>, key: K, make: impl FnOnce() -> T) -> T {
    let place = Arc::clone(things.lock().unwrap_or_else(PoisonError::into_inner).entry(key).or_default());
    place.get_or_init(make).clone()
}

/// The layout of group 0: the plan's uniforms, and the dispatch's at a dynamic offset.
pub fn uniforms_layout(gpu: &Handles) -> wgpu::BindGroupLayout {
    let entry = |binding, has_dynamic_offset| {
        layout_entry(
            binding,
            wgpu::BindingType::Buffer { ty: gpu.uniforms, has_dynamic_offset, min_binding_size: None },
        )
    };
    let entries = [entry(0, false), entry(1, true)];
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("uniforms"), entries: &entries })
}

fn layout_entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

impl Kernel {
    /// The stage that the kernel belongs to.
    pub fn stage(self) -> DrawStage {
        match self {
            Self::Transform => DrawStage::Transform,
            Self::Visibility { target: SampleTarget::Points | SampleTarget::Lists, .. }
            | Self::VisibilityTile { target: SampleTarget::Points | SampleTarget::Lists, .. } => DrawStage::Mixed,
            Self::Breaks | Self::Thin | Self::MixedPixels | Self::MixedColor => DrawStage::Mixed,
            Self::MixedParts | Self::MixedShade | Self::MixedSum => DrawStage::Mixed,
            Self::Visibility { .. } | Self::Clip | Self::VisibilityTile { .. } | Self::VisibilityFew { .. } => {
                DrawStage::Visibility
            }
            Self::Grid | Self::Gather => DrawStage::Occlusion,
            Self::Composite | Self::Shade | Self::Paint => DrawStage::Shade,
            Self::Holes | Self::Tips | Self::Fringes | Self::Edge | Self::Coverage | Self::LineLight => {
                DrawStage::Lines
            }
            Self::Resolve => DrawStage::Resolve,
        }
    }

    fn compile(self, gpu: &Handles, key: u32, cache: Option<&wgpu::PipelineCache>) -> Pipeline {
        let (device, label) = (&gpu.device, Some(self.entry()));
        let mut source = self.source_for(key);
        if gpu.uniforms != wgpu::BufferBindingType::Uniform {
            source = source.replace("var<uniform>", "var<storage, read>");
        }
        let bound = Reflection::of(self.entry(), &source).buffers;
        let entries: Vec<_> = bound.iter().map(|&(slot, access)| buffer_entry(slot, access)).collect();
        let buffers = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&uniforms_layout(gpu)), Some(&buffers)],
            immediate_size: 0,
        });
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&layout),
            module: &module,
            entry_point: label,
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &self.constants(key),
                // The kernels write their workgroup memory before they read it.
                zero_initialize_workgroup_memory: false,
            },
            cache,
        });
        Pipeline { pipeline, slots: bound.into_iter().map(|(slot, _)| slot).collect(), buffers }
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
