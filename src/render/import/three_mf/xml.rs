//! The reader of the XML in 3MF packages. It gives elements and attributes by their names without
//! prefixes, with the namespaces of elements. A part with a DTD is refused, so that a file cannot
//! declare entities that expand without bound.

use super::namespaces::{Space, Spaces};
use crate::guard::guarded;
use crate::import::bundle::show;
use crate::import::context::Context;
use crate::import::{MeshError, text};
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{Prefix, QName};
use quick_xml::{Reader, XmlVersion};

/// Depth of elements. The format needs seven.
const DEPTH_MAX: usize = 64;
/// Bytes of one element's attributes.
const ATTRIBUTES_BYTES_MAX: usize = 1 << 20;
/// Elements between two deadline checks.
const ELEMENTS_PER_POLL: u64 = 1 << 16;

/// An element that begins.
pub struct Element<'e> {
    event: &'e BytesStart<'e>,
    part: &'e str,
    at: u64,
    spaces: &'e Spaces,
}

/// Receives a part's elements.
pub trait Visitor {
    /// An element begins; `depth` is 0 for the root.
    fn begin(&mut self, element: &Element<'_>, depth: usize, cx: &mut Context<'_>) -> Result<(), MeshError>;
    /// An element ends.
    fn end(&mut self, name: &str, space: Space, cx: &mut Context<'_>) -> Result<(), MeshError>;
}

/// Walks through the part of this name.
pub fn walk(part: &str, bytes: &[u8], visitor: &mut impl Visitor, cx: &mut Context<'_>) -> Result<(), MeshError> {
    guarded("XML", || walk_elements(part, bytes, visitor, cx))?
}

fn walk_elements(part: &str, bytes: &[u8], visitor: &mut impl Visitor, cx: &mut Context<'_>) -> Result<(), MeshError> {
    let bytes = text::to_utf8(bytes, cx.budget)?;
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let broken =
        |at: u64, what: &str| MeshError::broken(format!("byte {at} of the 3MF part \"{}\": {what}", show(part)));
    let document = std::str::from_utf8(bytes)
        .map_err(|error| broken(error.valid_up_to() as u64, "the text is neither UTF-8 nor UTF-16"))?;
    let mut reader = Reader::from_str(document);
    let mut spaces = Spaces::default();
    let (mut depth, mut met, mut has_root) = (0, 0_u64, false);
    loop {
        met += 1;
        if met.is_multiple_of(ELEMENTS_PER_POLL) {
            cx.deadline.check()?;
        }
        let at = reader.buffer_position();
        let event = reader.read_event().map_err(|error| broken(reader.error_position(), &text::foreign(error)))?;
        match event {
            Event::Start(event) => {
                has_root = true;
                visitor.begin(&element(&event, part, at, &mut spaces, depth)?, depth, cx)?;
                depth += 1;
                if depth > DEPTH_MAX {
                    return Err(broken(at, &format!("elements are more than {DEPTH_MAX} deep")));
                }
            }
            Event::Empty(event) => {
                has_root = true;
                visitor.begin(&element(&event, part, at, &mut spaces, depth)?, depth, cx)?;
                visitor.end(event.local_name().into_inner(), space(&spaces, event.name()), cx)?;
                spaces.end(depth);
            }
            Event::End(event) => {
                depth = depth.saturating_sub(1);
                visitor.end(event.local_name().into_inner(), space(&spaces, event.name()), cx)?;
                spaces.end(depth);
            }
            Event::DocType(_) => return Err(broken(at, "a DTD is not allowed in 3MF")),
            Event::Eof if depth > 0 => return Err(broken(at, "the text is cut off")),
            Event::Eof if !has_root => {
                return Err(broken(at, "there is no XML here, and a 3MF file is a zip archive of XML"));
            }
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

fn element<'e>(
    event: &'e BytesStart<'e>,
    part: &'e str,
    at: u64,
    spaces: &'e mut Spaces,
    depth: usize,
) -> Result<Element<'e>, MeshError> {
    let is_short = event.attributes_raw().len() <= ATTRIBUTES_BYTES_MAX;
    let are_few = !is_short || spaces.begin(event, depth);
    let element = Element { event, part, at, spaces };
    match (is_short, are_few) {
        (true, true) => Ok(element),
        (false, _) => Err(element.broken("the element's attributes are too long")),
        (true, false) => Err(element.broken("there are too many declarations of namespaces")),
    }
}

fn space(spaces: &Spaces, name: QName<'_>) -> Space {
    spaces.of(name.prefix().map_or("", Prefix::into_inner))
}

impl Element<'_> {
    /// The name without its prefix.
    pub fn name(&self) -> &str {
        self.event.local_name().into_inner()
    }

    /// The namespace of the element.
    pub fn space(&self) -> Space {
        space(self.spaces, self.event.name())
    }

    /// Namespaces of a list of required prefixes that are not read.
    pub fn unread(&self, prefixes: &str) -> Vec<String> {
        self.spaces.unread(prefixes)
    }

    /// Gives each attribute, by its name without a prefix, as it is in the file.
    pub fn each(&self, mut take: impl FnMut(&str, &str) -> Result<(), MeshError>) -> Result<(), MeshError> {
        let mut attributes = self.event.attributes();
        // Checking for duplicates is quadratic.
        for attribute in attributes.with_checks(false) {
            let attribute = attribute.map_err(|error| self.broken(&text::foreign(error)))?;
            take(attribute.key.local_name().into_inner(), &attribute.value)?;
        }
        Ok(())
    }

    /// The unescaped value of an attribute. None without the attribute.
    pub fn text(&self, name: &str) -> Result<Option<String>, MeshError> {
        let mut attributes = self.event.attributes();
        for attribute in attributes.with_checks(false) {
            let attribute = attribute.map_err(|error| self.broken(&text::foreign(error)))?;
            if attribute.key.local_name().into_inner() == name {
                let value = attribute.normalized_value(XmlVersion::Implicit1_0);
                return value.map(|value| Some(value.into_owned())).map_err(|error| self.broken(&text::foreign(error)));
            }
        }
        Ok(None)
    }

    /// An attribute that is a number, required or not.
    pub fn number<T: std::str::FromStr>(&self, name: &str) -> Result<Option<T>, MeshError> {
        match self.text(name)? {
            Some(value) => self.parse(name, &value).map(Some),
            None => Ok(None),
        }
    }

    /// A required attribute that is a number.
    pub fn needed<T: std::str::FromStr>(&self, name: &str) -> Result<T, MeshError> {
        self.number(name)?.ok_or_else(|| self.broken(&format!("the attribute \"{name}\" is missing")))
    }

    /// Parses a value that must be a number.
    pub fn parse<T: std::str::FromStr>(&self, name: &str, value: &str) -> Result<T, MeshError> {
        let parsed = value.trim_ascii().parse();
        parsed.map_err(|_| {
            self.broken(&format!("the attribute \"{name}\" is \"{}\", which is no number for it", show(value)))
        })
    }

    /// An error in this element.
    pub fn broken(&self, what: &str) -> MeshError {
        let name = show(self.name());
        MeshError::broken(format!("byte {} of the 3MF part \"{}\", <{name}>: {what}", self.at, show(self.part)))
    }
}
