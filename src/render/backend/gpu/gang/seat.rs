//! The data that a job brings to a gang (a job draws one picture; the jobs of a gang are drawn by the same
//! dispatches): its uniforms, its dispatches, and how much they write. Also the tests whether a job may be in a
//! gang at all, and whether two jobs are alike, so that one gang may hold both.

use std::any::Any;
use std::sync::Arc;

use super::turns::Seat;
use crate::backend::gpu::params::{Batch, Frame};
use crate::backend::gpu::pipelines::Kernel;
use crate::backend::gpu::pipelines::key::{GANG, pipeline_key};
use crate::backend::gpu::residents::Source;
use crate::backend::gpu::schedule::Schedule;
use crate::backend::gpu::schedule::sizes::{JOBS_MAX, OCCLUSION_BYTES, SAMPLE_BYTES, work_bytes};
use crate::backend::gpu::schedule::step::Step;
use crate::plan::{CornerValues, DrawPlan, MeshToken, ScreenVertex, ShadedMaterial, SharedSlice};

/// Bytes that the kernels of a gang write, at most. Larger pictures keep a GPU busy alone.
const WRITTEN_BYTES_MAX: u64 = 96 << 20;

/// Most materials of a job: those of waiting jobs are compared.
const MATERIALS_MAX: usize = 64;

/// A job's share in a gang.
#[derive(Clone)]
pub struct GangShare(Arc<Own>);

struct Own {
    kind: Kind,
    frame: Frame,
    dispatches: Vec<Dispatch>,
    amounts: Amounts,
}

/// The traits that the jobs of a gang have in common.
#[derive(PartialEq)]
struct Kind {
    key: u32,
    kernels: Vec<Kernel>,
    /// Owner, address and bytes of each list that kernels read; None for an empty one.
    lists: Vec<Option<(usize, usize, u64)>>,
    materials: Vec<ShadedMaterial>,
}

/// A run of a kernel for one job.
#[derive(Clone, Copy)]
pub struct Dispatch {
    pub kernel: Kernel,
    pub batch: Batch,
    pub workgroups: [u32; 2],
}

/// Elements that the kernels write for a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Amounts {
    pub vertices: u32,
    pub samples: u32,
    pub items: u32,
    pub pixels: u32,
}

/// True for a plan of a surface alone. Lines, layers and hulls have more to clear, to wait for, or to bring.
pub fn may_share(plan: &DrawPlan<'_>) -> bool {
    let has_more = !plan.lines.is_empty() || plan.peeling().is_some() || plan.hull.is_some();
    plan.is_shaded() && !has_more && !plan.is_adaptive && plan.pass_masks.is_empty()
}

impl GangShare {
    /// The share of a job; None if the job is drawn alone.
    pub fn of(plan: &DrawPlan<'_>, schedule: &Schedule) -> Option<Self> {
        let is_one_band = schedule.banding.rows >= plan.height_px && schedule.banding.beyond == 0;
        if !may_share(plan) || !is_one_band {
            return None;
        }
        let dispatches = dispatches(schedule)?;
        let kernels = dispatches.iter().map(|dispatch| dispatch.kernel).collect();
        let materials = &plan.surface.as_ref()?.materials;
        let kind = Kind {
            key: pipeline_key(plan) | GANG,
            kernels,
            lists: lists(plan)?,
            materials: (materials.len() <= MATERIALS_MAX).then(|| materials.clone())?,
        };
        let amounts = Amounts {
            vertices: u32::try_from(plan.positions.len()).ok()?,
            samples: u32::try_from(schedule.banding.seen_samples(plan)).ok()?,
            items: schedule.work_items,
            pixels: plan.width_px * plan.height_px,
        };
        let own = Own { kind, frame: Frame::new(plan), dispatches, amounts };
        (amounts.bytes() <= WRITTEN_BYTES_MAX / 2).then(|| Self(Arc::new(own)))
    }

    /// The pipeline key.
    pub fn key(&self) -> u32 {
        self.0.kind.key
    }

    /// The job's uniforms.
    pub fn frame(&self) -> &Frame {
        &self.0.frame
    }

    /// Its runs of kernels.
    pub fn dispatches(&self) -> &[Dispatch] {
        &self.0.dispatches
    }

    /// Its shares of what kernels write.
    pub fn amounts(&self) -> Amounts {
        self.0.amounts
    }
}

impl Seat for GangShare {
    fn is_alike(&self, other: &Self) -> bool {
        // Of equal size, so that a gang of the largest number of jobs has room.
        Arc::ptr_eq(&self.0, &other.0) || (self.0.amounts == other.0.amounts && self.0.kind == other.0.kind)
    }

    fn gang_max(&self) -> usize {
        JOBS_MAX.min((WRITTEN_BYTES_MAX / self.0.amounts.bytes().max(1)) as usize)
    }
}

impl Amounts {
    fn bytes(&self) -> u64 {
        u64::from(self.vertices) * size_of::<ScreenVertex>() as u64
            + u64::from(self.samples) * SAMPLE_BYTES
            + work_bytes(self.items)
            + u64::from(self.pixels) * (4 + 16 + OCCLUSION_BYTES)
    }
}

/// The runs of kernels of a schedule that has no other steps.
fn dispatches(schedule: &Schedule) -> Option<Vec<Dispatch>> {
    let mut all = Vec::new();
    for step in &schedule.steps {
        let (kernel, batch, workgroups) = match *step {
            Step::Dispatch { kernel, batch, workgroups } => (kernel, batch, workgroups),
            Step::Tiles { kernel, batch } if !schedule.tiles.in_rounds => {
                (kernel, batch, [schedule.tiles.workgroups, 1])
            }
            Step::ClearBand { samples: false } | Step::Submit | Step::EndBand(_) => continue,
            _ => return None,
        };
        let batch = *schedule.batches.get(batch)?;
        // A job of a gang has its own start in what kernels write.
        let begins_anywhere = batch.samples_at == 0 && batch.rgba_at == 0;
        all.push((kernel.is_shared() && begins_anywhere).then_some(Dispatch { kernel, batch, workgroups })?);
    }
    Some(all)
}

/// The lists that kernels read of the mesh; None if one is of this plan alone.
fn lists(plan: &DrawPlan<'_>) -> Option<Vec<Option<(usize, usize, u64)>>> {
    let (mesh, surface) = (plan.mesh.as_ref(), plan.surface.as_ref()?);
    if !surface.edge_masks.is_empty() {
        return None;
    }
    let mut all = vec![
        list(&plan.positions, mesh)?,
        list(&plan.triangles, mesh)?,
        list(&surface.triangle_materials, mesh)?,
        list(&surface.face_normals, mesh)?,
        list(&surface.second_uvs, mesh)?,
    ];
    all.extend(corners(surface.vertex_normals.as_ref(), mesh)?);
    all.extend(corners(surface.uvs.as_ref(), mesh)?);
    all.extend(corners(surface.colors.as_ref(), mesh)?);
    let textures = &surface.textures;
    let is_bare = textures.images.is_empty();
    all.push(if is_bare { None } else { Some(Source::of_arc(textures, 0)?.identity()) });
    Some(all)
}

fn corners<T: Any + Send + Sync>(
    values: Option<&CornerValues<'_, T>>,
    mesh: Option<&Arc<MeshToken>>,
) -> Option<[Option<(usize, usize, u64)>; 2]> {
    let Some(CornerValues { values, triangles }) = values else { return Some([None, None]) };
    Some([list(values, mesh)?, list(triangles, mesh)?])
}

/// The list's identity; an empty list has none. None if the plan alone has it.
fn list<T: Any + Send + Sync>(
    list: &SharedSlice<'_, T>,
    mesh: Option<&Arc<MeshToken>>,
) -> Option<Option<(usize, usize, u64)>> {
    if list.is_empty() { Some(None) } else { Source::of(list, mesh).map(|source| Some(source.identity())) }
}
