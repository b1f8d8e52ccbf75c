//! XML namespaces of 3MF files: the specification that each element belongs to, and the extensions
//! that a file requires of its readers.

use crate::import::text;
use quick_xml::events::BytesStart;
use quick_xml::name::PrefixDeclaration;

/// "3MF Core Specification", which all others extend, of any year.
const CORE: [&str; 2] =
    ["http://schemas.microsoft.com/3dmanufacturing/core/", "http://schemas.microsoft.com/3dmanufacturing/2013/01"];
/// "Materials and Properties Extension".
const MATERIALS: &str = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02";
/// Beam lattices begin with this, whatever their year.
const BEAMS: &str = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/";
/// Extensions that may be required: they are read, or do not change the shape.
const READ: [&str; 3] = [
    MATERIALS,
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

/// Most declarations in scope. Every element is compared with all of them.
const DECLARED_MAX: usize = 64;
/// Characters that are kept of a namespace.
const URI_CHARS_MAX: usize = 200;

/// The namespace of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The format's own.
    Core,
    /// Colours and textures.
    Materials,
    /// Beam lattices.
    Beams,
    /// An extension that is not read.
    Other,
    /// No declaration: some writers declare no namespaces at all.
    Unsaid,
}

impl Space {
    /// True if the core specification's names apply to the element.
    pub fn is_core(self) -> bool {
        matches!(self, Self::Core | Self::Unsaid)
    }

    /// True if the materials extension's names apply to the element.
    pub fn is_materials(self) -> bool {
        matches!(self, Self::Materials | Self::Unsaid)
    }

    fn of(uri: &str) -> Self {
        match uri {
            _ if CORE.iter().any(|core| uri.starts_with(core)) => Self::Core,
            MATERIALS => Self::Materials,
            _ if uri.starts_with(BEAMS) => Self::Beams,
            _ => Self::Other,
        }
    }
}

/// The declarations in scope.
#[derive(Debug, Default)]
pub struct Spaces {
    /// Depth, prefix and namespace. The last one counts.
    declared: Vec<(usize, String, String)>,
}

impl Spaces {
    /// Adds the declarations of an element at this depth. False if there are too many.
    pub fn begin(&mut self, event: &BytesStart<'_>, depth: usize) -> bool {
        if !event.attributes_raw().contains("xmlns") {
            return true;
        }
        // Broken attributes are reported where they are read.
        for attribute in event.attributes().with_checks(false).flatten() {
            let prefix = match attribute.key.as_namespace_binding() {
                Some(PrefixDeclaration::Default) => "",
                Some(PrefixDeclaration::Named(prefix)) => prefix,
                None => continue,
            };
            if self.declared.len() == DECLARED_MAX {
                return false;
            }
            let uri = text::cut(attribute.value.trim(), URI_CHARS_MAX);
            self.declared.push((depth, text::name(prefix), uri));
        }
        true
    }

    /// Removes the declarations of an element at this depth.
    pub fn end(&mut self, depth: usize) {
        while self.declared.last().is_some_and(|declared| declared.0 >= depth) {
            self.declared.pop();
        }
    }

    /// The namespace of a prefix. "" is the default one.
    pub fn of(&self, prefix: &str) -> Space {
        self.uri(prefix).map_or(Space::Unsaid, Space::of)
    }

    /// Namespaces of a list of required prefixes that are not read.
    pub fn unread(&self, prefixes: &str) -> Vec<String> {
        let uri = |prefix| self.uri(prefix).unwrap_or(prefix);
        let unread = prefixes
            .split_ascii_whitespace()
            .map(uri)
            .filter(|uri| !READ.contains(uri) && Space::of(uri) != Space::Core);
        unread.map(str::to_owned).collect()
    }

    fn uri(&self, prefix: &str) -> Option<&str> {
        self.declared.iter().rev().find(|declared| declared.1 == prefix).map(|declared| declared.2.as_str())
    }
}
