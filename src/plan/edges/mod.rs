//! What a mesh's edges tell a plan, found when something first asks.

pub(crate) mod silhouettes;
use self::silhouettes::Silhouettes;
use super::PlanError;
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::plan::context::PlanContext;
use crate::scene::material_groups::MaterialGroups;

/// A mesh's edges and silhouettes, found once each, and then kept.
#[derive(Default)]
pub struct Edges<'a> {
    list: Option<EdgeList>,
    silhouettes: Option<Silhouettes<'a>>,
}

impl<'a> Edges<'a> {
    /// All edges.
    pub fn of(&mut self, mesh: &Mesh, cx: &mut PlanContext<'_>) -> Result<&EdgeList, PlanError> {
        let list = match self.list.take() {
            Some(list) => list,
            None => {
                cx.deadline.check()?;
                EdgeList::of(mesh, cx.budget)?
            }
        };
        Ok(self.list.insert(list))
    }

    /// All edges, and which of them may be silhouettes: for contours and hulls, which are those of the same groups.
    pub fn with_silhouettes(
        &mut self,
        mesh: &'a Mesh,
        groups: &MaterialGroups<'_>,
        cx: &mut PlanContext<'_>,
    ) -> Result<(&EdgeList, &Silhouettes<'a>), PlanError> {
        self.of(mesh, cx)?;
        let list = self.list.get_or_insert_default();
        let silhouettes = match self.silhouettes.take() {
            Some(silhouettes) => silhouettes,
            None => Silhouettes::new(mesh, groups, list, cx.budget)?,
        };
        Ok((list, self.silhouettes.insert(silhouettes)))
    }
}
