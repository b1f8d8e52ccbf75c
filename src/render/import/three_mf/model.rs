//! One model part (an XML file) of a 3MF package: its objects (meshes or groups of other objects),
//! its build items (objects that are to be printed), and its groups of colours.

use super::namespaces::Space;
use super::values::{color, transform};
use super::xml::{Element, Visitor};
use crate::import::affine::Affine;
use crate::import::bundle::show_all;
use crate::import::context::Context;
use crate::import::{MeshError, MeshFault, text};
use crate::mesh::MaterialSlot;
use rapidhash::RapidHashMap;

/// No property.
pub const NONE: u32 = u32::MAX;
/// Vertices or triangles per payment.
const PAID_AT_ONCE: usize = 1024;

/// A part, as the file has it.
#[derive(Debug, Default)]
pub struct Model {
    /// Objects by their numbers.
    pub objects: RapidHashMap<u32, Object>,
    /// Numbers of the objects, in the file's order.
    pub order: Vec<u32>,
    /// The build items.
    pub items: Vec<Placed>,
    /// Colours by the numbers of their groups.
    pub groups: RapidHashMap<u32, Group>,
    /// Groups of properties that are not read.
    pub unread_groups: u64,
    /// Meshes with a lattice of beams.
    pub beam_lattices: u64,
    open: Open,
}

/// An object: a mesh or components. Files that break the rules have both.
#[derive(Debug, Default)]
pub struct Object {
    /// Its vertices.
    pub vertices: Vec<[f64; 3]>,
    /// Its triangles.
    pub triangles: Vec<Triangle>,
    /// Other objects in it.
    pub components: Vec<Placed>,
    property: [u32; 2],
}

/// A triangle and its properties: a group, and an index into it for each corner.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Vertices of the object, all in range.
    pub corners: [u32; 3],
    /// Number of the group, or [`NONE`].
    pub group: u32,
    /// Indices into it; not yet checked.
    pub indices: [u32; 3],
}

/// A reference to an object, with its transform.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Its id in its part.
    pub object: u32,
    /// Path of another part (production extension), or empty.
    pub path: String,
    /// Its transform.
    pub transform: Affine,
}

/// Colours that triangles refer to.
#[derive(Debug, Default)]
pub struct Group {
    /// Linear RGBA.
    pub colors: Vec<[f32; 4]>,
    /// Names of base materials; none for a colour group.
    pub names: Option<Vec<String>>,
}

/// The visitor's place in the document.
#[derive(Debug, Default)]
struct Open {
    object: Option<u32>,
    group: Option<u32>,
    unpaid: usize,
}

impl Visitor for Model {
    fn begin(&mut self, element: &Element<'_>, depth: usize, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let space = element.space();
        if depth == 0 {
            return root(element, space);
        }
        match element.name() {
            "beamlattice" if space == Space::Beams => {
                self.beam_lattices += 1;
                Ok(())
            }
            "colorgroup" if space.is_materials() => self.group(element, None, cx),
            "color" if space.is_materials() => self.color(element, "color", cx),
            "texture2dgroup" | "compositematerials" | "multiproperties" if space.is_materials() => {
                self.unread_groups += 1;
                Ok(())
            }
            // Slices and other extensions have vertices and names of their own.
            _ if !space.is_core() => Ok(()),
            "object" => self.object(element, cx),
            "vertex" => self.vertex(element, cx),
            "triangle" => self.triangle(element, cx),
            "component" => {
                let placed = placed(element, cx)?;
                if let Some(object) = self.open_object() {
                    object.components.push(placed);
                }
                Ok(())
            }
            "item" => {
                self.items.push(placed(element, cx)?);
                Ok(())
            }
            "basematerials" => self.group(element, Some(Vec::new()), cx),
            "base" => self.color(element, "displaycolor", cx),
            _ => Ok(()),
        }
    }

    fn end(&mut self, name: &str, space: Space, cx: &mut Context<'_>) -> Result<(), MeshError> {
        match name {
            "colorgroup" if space.is_materials() => self.open.group = None,
            _ if !space.is_core() => {}
            "object" => {
                if let Some(object) = self.open_object() {
                    object.finish()?;
                }
                self.open.object = None;
            }
            "basematerials" => self.open.group = None,
            "mesh" => cx.deadline.check()?,
            _ => {}
        }
        Ok(())
    }
}

/// Reads the root element, with the extensions that it requires.
fn root(element: &Element<'_>, space: Space) -> Result<(), MeshError> {
    if element.name() != "model" || !space.is_core() {
        return Err(element.broken("a part begins with <model>"));
    }
    let unread = element.unread(&element.text("requiredextensions")?.unwrap_or_default());
    if unread.is_empty() {
        return Ok(());
    }
    let names = show_all(unread.iter().map(String::as_str));
    let detail = format!("the 3MF file requires extensions that are not read: {names}");
    Err(MeshError::new(MeshFault::Unsupported, detail))
}

impl Model {
    fn open_object(&mut self) -> Option<&mut Object> {
        self.open.object.and_then(|id| self.objects.get_mut(&id))
    }

    fn object(&mut self, element: &Element<'_>, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let id: u32 = element.needed("id")?;
        cx.budget.spend("the objects of the 3MF file", 1, 2 * (size_of::<Object>() as u64 + 16))?;
        let pid = element.number("pid")?.unwrap_or(NONE);
        let pindex = element.number("pindex")?.unwrap_or(NONE);
        let object = Object { property: [pid, pindex], ..Object::default() };
        if self.objects.insert(id, object).is_some() {
            return Err(element.broken(&format!("two objects have the number {id}")));
        }
        self.order.push(id);
        self.open.object = Some(id);
        Ok(())
    }

    fn vertex(&mut self, element: &Element<'_>, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let mut position = [None; 3];
        element.each(|name, value| {
            if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
                position[axis] = Some(element.parse(name, value)?);
            }
            Ok(())
        })?;
        let [Some(x), Some(y), Some(z)] = position else { return Err(element.broken("a vertex needs x, y and z")) };
        self.pay(cx)?;
        if let Some(object) = self.open_object() {
            object.vertices.push([x, y, z]);
        }
        Ok(())
    }

    fn triangle(&mut self, element: &Element<'_>, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let mut corners = [NONE; 3];
        let mut property = [NONE; 4];
        element.each(|name, value| {
            if let Some(k) = ["v1", "v2", "v3"].iter().position(|known| *known == name) {
                corners[k] = element.parse(name, value)?;
            } else if let Some(k) = ["pid", "p1", "p2", "p3"].iter().position(|known| *known == name) {
                property[k] = element.parse(name, value)?;
            }
            Ok(())
        })?;
        if corners.contains(&NONE) {
            return Err(element.broken("a triangle needs v1, v2 and v3"));
        }
        self.pay(cx)?;
        let Some(object) = self.open_object() else { return Ok(()) };
        let [pid, p1, p2, p3] = property;
        let or = |own: u32, other: u32| if own == NONE { other } else { own };
        let first = or(p1, object.property[1]);
        let group = or(pid, object.property[0]);
        object.triangles.push(Triangle { corners, group, indices: [first, or(p2, first), or(p3, first)] });
        let count = object.triangles.len() as u64;
        if count.is_multiple_of(PAID_AT_ONCE as u64) {
            cx.check_triangles(count)?;
        }
        Ok(())
    }

    fn pay(&mut self, cx: &mut Context<'_>) -> Result<(), MeshError> {
        if self.open.unpaid == 0 {
            self.open.unpaid = PAID_AT_ONCE;
            // A vertex takes no more than a triangle, and lists double when they grow.
            let bytes = 2 * size_of::<Triangle>() as u64;
            cx.budget.spend("the meshes of the 3MF file", PAID_AT_ONCE as u64, bytes)?;
        }
        self.open.unpaid -= 1;
        Ok(())
    }

    fn group(
        &mut self,
        element: &Element<'_>,
        names: Option<Vec<String>>,
        cx: &mut Context<'_>,
    ) -> Result<(), MeshError> {
        let id: u32 = element.needed("id")?;
        cx.budget.spend("the colours of the 3MF file", 1, 2 * (size_of::<Group>() as u64 + 16))?;
        self.groups.insert(id, Group { colors: Vec::new(), names });
        self.open.group = Some(id);
        Ok(())
    }

    fn color(&mut self, element: &Element<'_>, attribute: &str, cx: &mut Context<'_>) -> Result<(), MeshError> {
        let Some(group) = self.open.group.and_then(|id| self.groups.get_mut(&id)) else { return Ok(()) };
        let text = element.text(attribute)?.unwrap_or_default();
        let color = color(&text).ok_or_else(|| element.broken("a colour is #RRGGBB or #RRGGBBAA"))?;
        let name = text::name(&element.text("name")?.unwrap_or_default());
        // A base material may become a slot.
        let slot = if group.names.is_some() { size_of::<MaterialSlot>() as u64 + 64 } else { 0 };
        cx.budget.spend("the colours of the 3MF file", 1, 2 * (16 + 24 + name.len() as u64 + slot))?;
        group.colors.push(color);
        if let Some(names) = &mut group.names {
            names.push(name);
        }
        Ok(())
    }
}

impl Object {
    /// Vertices may come after the triangles that use them.
    fn finish(&self) -> Result<(), MeshError> {
        let count = self.vertices.len();
        match self.triangles.iter().flat_map(|triangle| triangle.corners).find(|&v| v as usize >= count) {
            None => Ok(()),
            Some(v) => Err(MeshError::broken(format!(
                "a triangle of the 3MF file refers to vertex {v}, and its object has {count}, the first of them 0"
            ))),
        }
    }
}

fn placed(element: &Element<'_>, cx: &mut Context<'_>) -> Result<Placed, MeshError> {
    let object = element.needed("objectid")?;
    let path = element.text("path")?.unwrap_or_default();
    cx.budget.spend("the components of the 3MF file", 1, 2 * (size_of::<Placed>() + path.len()) as u64)?;
    let transform = match element.text("transform")? {
        None => Affine::IDENTITY,
        Some(text) => transform(&text).ok_or_else(|| element.broken("a transform has twelve numbers"))?,
    };
    Ok(Placed { object, path, transform })
}
