//! XML namespaces, as far as it matters here: whose an element is, and what the prefixes stand for that a part requires.

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
/// What may be required: it is read, or says nothing of the shape.
const READ: [&str; 3] = [
    MATERIALS,
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

/// Declarations that may hold at one place. Every element is held against them.
const DECLARED_MAX: usize = 64;
/// Characters that are kept of a namespace.
const URI_CHARS_MAX: usize = 200;

/// Whose an element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The format's own.
    Core,
    /// Colours and textures.
    Materials,
    /// Beam lattices.
    Beams,
    /// Of an extension that is not read.
    Other,
    /// Nothing says: some writers declare no namespaces at all.
    Unsaid,
}

impl Space {
    /// Whether the format's own names mean something here.
    pub fn is_core(self) -> bool {
        matches!(self, Self::Core | Self::Unsaid)
    }

    /// The same of the names of the materials extension.
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

/// The declarations that hold where the reader is.
#[derive(Debug, Default)]
pub struct Spaces {
    /// Depth, prefix and namespace; the last one counts.
    declared: Vec<(usize, String, String)>,
}

impl Spaces {
    /// Takes in what an element at this depth declares; whether that is few enough.
    pub fn begin(&mut self, event: &BytesStart<'_>, depth: usize) -> bool {
        if !event.attributes_raw().contains("xmlns") {
            return true;
        }
        // What is broken here is told by whoever reads the attributes.
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

    /// Forgets what an element at this depth has declared.
    pub fn end(&mut self, depth: usize) {
        while self.declared.last().is_some_and(|declared| declared.0 >= depth) {
            self.declared.pop();
        }
    }

    /// What a prefix stands for; "" is none.
    pub fn of(&self, prefix: &str) -> Space {
        self.uri(prefix).map_or(Space::Unsaid, Space::of)
    }

    /// The namespaces of a list of prefixes that a file may not require.
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
