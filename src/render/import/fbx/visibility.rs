//! The visibility of the nodes of an FBX scene. A node that the file hides is not drawn, and
//! neither are its children, except those that do not inherit visibility. Of an object in several
//! levels of detail the first is drawn. A level that the file marks as shown or hidden follows that
//! mark instead.

use crate::import::MeshError;
use crate::import::context::Context;
use ufbx::{ElementData, LodDisplay, Node, Scene};

/// The visibility of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// It is drawn.
    Shown,
    /// The file hides it or a parent.
    Hidden,
    /// It belongs to a level of detail that is not drawn.
    OtherDetailLevel,
}

/// The visibility of all nodes of a scene.
pub struct Visibilities(Vec<Visibility>);

impl Visibilities {
    /// Finds it. Parents come before their children in a scene.
    pub fn of(scene: &Scene, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        cx.budget.spend("the nodes of the FBX file", scene.nodes.len() as u64, size_of::<Visibility>() as u64)?;
        let mut visibilities = vec![Visibility::Shown; scene.nodes.len()];
        for (i, node) in (&scene.nodes).into_iter().enumerate() {
            if i.is_multiple_of(4096) {
                cx.deadline.check()?;
            }
            let above =
                node.parent.as_ref().and_then(|parent| visibilities.get(parent.element.typed_id as usize)).copied();
            let own = match (above, visibilities[i]) {
                // All of a level that is not drawn. Its group has said so of the top.
                (Some(Visibility::OtherDetailLevel), _) | (_, Visibility::OtherDetailLevel) => {
                    Visibility::OtherDetailLevel
                }
                _ if !node.visible => Visibility::Hidden,
                (Some(Visibility::Hidden), _) if inherits(node) => Visibility::Hidden,
                _ => Visibility::Shown,
            };
            visibilities[i] = own;
            // Also of a hidden group, because some levels do not inherit visibility.
            if own != Visibility::OtherDetailLevel {
                for (level, child) in (&node.children).into_iter().enumerate() {
                    if let Some(visibility) =
                        visibilities.get_mut(child.element.typed_id as usize).filter(|_| !is_drawn(node, level))
                    {
                        *visibility = Visibility::OtherDetailLevel;
                    }
                }
            }
        }
        Ok(Self(visibilities))
    }

    /// The visibility of a node.
    pub fn at(&self, node: &Node) -> Visibility {
        self.0.get(node.element.typed_id as usize).copied().unwrap_or(Visibility::Shown)
    }
}

/// True if a hidden parent hides the node.
fn inherits(node: &Node) -> bool {
    node.element.props.find_prop("Visibility Inheritance").is_none_or(|prop| prop.value_int != 0)
}

/// False if a child of a node is a level of detail that is not drawn. The first, which is the finest,
/// is drawn, unless the group says of a level whether it is shown.
fn is_drawn(node: &Node, level: usize) -> bool {
    let Some(ElementData::LodGroup(group)) = node.attrib.as_ref().map(|element| element.as_data()) else { return true };
    match group.lod_levels.get(level).map(|level| level.display) {
        Some(LodDisplay::Show) => true,
        Some(LodDisplay::Hide) => false,
        Some(LodDisplay::UseLod) | None => level == 0,
    }
}
