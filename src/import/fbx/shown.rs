//! Which nodes are drawn: not those below a hidden one, nor the coarser levels of detail of what is there in several.

use crate::import::MeshError;
use crate::import::context::Context;
use ufbx::{ElementData, LodDisplay, Node, Scene};

/// What becomes of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is drawn.
    Shown,
    /// The file hides it, or a node above.
    Hidden,
    /// It is, or is below, a level of detail that is not drawn.
    OtherLevel,
}

/// The fates of all nodes of a scene.
pub struct Fates(Vec<Fate>);

impl Fates {
    /// Finds them. Parents come before their children in a scene.
    pub fn of(scene: &Scene, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        cx.budget.spend("the nodes of the FBX file", scene.nodes.len() as u64, size_of::<Fate>() as u64)?;
        let mut fates = vec![Fate::Shown; scene.nodes.len()];
        for (i, node) in (&scene.nodes).into_iter().enumerate() {
            if i.is_multiple_of(4096) {
                cx.deadline.check()?;
            }
            let above = node.parent.as_ref().and_then(|parent| fates.get(parent.element.typed_id as usize)).copied();
            let own = match above {
                _ if !node.visible => Fate::Hidden,
                Some(Fate::Hidden) if inherits(node) => Fate::Hidden,
                Some(Fate::OtherLevel) => Fate::OtherLevel,
                // Set by the group below.
                _ => fates[i],
            };
            fates[i] = own;
            if own == Fate::Shown {
                for (level, child) in (&node.children).into_iter().enumerate() {
                    if let Some(fate) =
                        fates.get_mut(child.element.typed_id as usize).filter(|_| !is_drawn(node, level))
                    {
                        *fate = Fate::OtherLevel;
                    }
                }
            }
        }
        Ok(Self(fates))
    }

    /// What becomes of a node.
    pub fn at(&self, node: &Node) -> Fate {
        self.0.get(node.element.typed_id as usize).copied().unwrap_or(Fate::Shown)
    }
}

/// Whether a hidden parent hides the node.
fn inherits(node: &Node) -> bool {
    node.element.props.find_prop("Visibility Inheritance").is_none_or(|prop| prop.value_int != 0)
}

/// Whether a child of the node is drawn, as far as levels of detail go: the first, which is the finest, unless the group says
/// which.
fn is_drawn(node: &Node, level: usize) -> bool {
    let Some(ElementData::LodGroup(group)) = node.attrib.as_ref().map(|element| element.as_data()) else { return true };
    match group.lod_levels.get(level).map(|level| level.display) {
        Some(LodDisplay::Show) => true,
        Some(LodDisplay::Hide) => false,
        Some(LodDisplay::UseLod) | None => level == 0,
    }
}
