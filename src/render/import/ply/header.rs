//! The header of a PLY file: the encoding, the names of textures, and the elements (kinds of records,
//! such as `vertex`) with their counts and properties.

use crate::import::MeshError;
use crate::import::bundle::show;

/// Longest header that is read. Real ones are a few kilobytes, comments and all.
const HEADER_BYTES_MAX: usize = 1 << 20;
/// Longest line of a header.
const LINE_BYTES_MAX: usize = 16 << 10;
/// Most elements, properties (of all elements together) and textures of a header.
const ELEMENTS_MAX: usize = 256;
const PROPERTIES_MAX: usize = 4096;
const TEXTURES_MAX: usize = 1000;

/// The encoding of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Words.
    Text,
    /// Numbers, least significant byte first.
    LittleEndian,
    /// Numbers, most significant byte first.
    BigEndian,
}

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `char`
    I8,
    /// `uchar`
    U8,
    /// `short`
    I16,
    /// `ushort`
    U16,
    /// `int`
    I32,
    /// `uint`
    U32,
    /// `float`
    F32,
    /// `double`
    F64,
}

/// The content of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// One number.
    One(Kind),
    /// A count, then that many items.
    List {
        /// Type of the count.
        count: Kind,
        /// Type of the items.
        item: Kind,
    },
}

/// A property of an element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Its name in the file.
    pub name: String,
    /// Its content.
    pub shape: Shape,
}

/// A declared kind of record, with its count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// Its name in the file.
    pub name: String,
    /// Records in the body, if the header is honest.
    pub count: u64,
    /// Properties of a record, in order.
    pub properties: Vec<Property>,
}

/// A parsed header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// The encoding of the body.
    pub encoding: Encoding,
    /// Elements of the body, in order.
    pub elements: Vec<Element>,
    /// Names in `comment TextureFile` lines, MeshLab's convention.
    pub textures: Vec<Vec<u8>>,
    /// Offset of the body.
    pub body_at: usize,
    /// The line end.
    pub newline: u8,
}

impl Kind {
    /// Bytes in a binary body.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }
}

impl Element {
    /// The fewest bytes that a record takes. In a text every number is at least a digit and a
    /// space.
    pub fn record_bytes_min(&self, encoding: Encoding) -> u64 {
        let bytes = |property: &Property| match (encoding, property.shape) {
            (Encoding::Text, _) => 2,
            (_, Shape::One(kind) | Shape::List { count: kind, .. }) => kind.bytes() as u64,
        };
        self.properties.iter().map(bytes).sum()
    }
}

/// True if the first line is `ply`, as in every PLY file.
pub fn is_ply(bytes: &[u8]) -> bool {
    let rest = bytes.strip_prefix(b"ply").unwrap_or_default();
    rest.iter().find(|b| !matches!(b, b' ' | b'\t')).is_some_and(|b| matches!(b, b'\n' | b'\r'))
}

/// Reads the header.
pub fn parse(bytes: &[u8]) -> Result<Header, MeshError> {
    if !is_ply(bytes) {
        return Err(MeshError::broken("the PLY file does not begin with a line that says \"ply\""));
    }
    let mut draft = Draft { lines: Lines::new(bytes), encoding: None, elements: Vec::new(), properties: 0 };
    let mut textures = Vec::new();
    loop {
        let line = draft.lines.next()?;
        let (keyword, rest) = split_word(line.trim_ascii());
        match keyword {
            b"end_header" => break,
            b"comment" => textures.extend(texture_file(rest)),
            b"" | b"ply" | b"obj_info" => {}
            b"format" => draft.format(rest)?,
            b"element" => draft.element(rest)?,
            b"property" => draft.property(rest)?,
            other => return Err(draft.lines.fault(&format!("\"{}\" is no word that a line begins with", word(other)))),
        }
        if textures.len() > TEXTURES_MAX {
            return Err(draft.lines.fault(&format!("more than {TEXTURES_MAX} textures are named")));
        }
    }
    let Draft { lines, encoding, elements, .. } = draft;
    let encoding = encoding.ok_or_else(|| MeshError::broken("the PLY header has no \"format\" line"))?;
    Ok(Header { encoding, elements, textures, body_at: lines.at, newline: lines.newline })
}

/// A short, printable form of some bytes of the file.
pub fn word(bytes: &[u8]) -> String {
    show(&String::from_utf8_lossy(&bytes[..bytes.len().min(60)]))
}

struct Draft<'a> {
    lines: Lines<'a>,
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    /// Number of properties of all elements.
    properties: usize,
}

impl Draft<'_> {
    fn format(&mut self, rest: &[u8]) -> Result<(), MeshError> {
        let (name, version) = split_word(rest);
        self.encoding = Some(match name {
            b"ascii" => Encoding::Text,
            b"binary_little_endian" => Encoding::LittleEndian,
            b"binary_big_endian" => Encoding::BigEndian,
            other => {
                let known = "ascii, binary_little_endian or binary_big_endian";
                return Err(self.lines.fault(&format!("the format \"{}\" is not {known}", word(other))));
            }
        });
        if version != b"1.0" {
            return Err(self.lines.fault(&format!("the version is \"{}\", and 1.0 is the only one", word(version))));
        }
        Ok(())
    }

    fn element(&mut self, rest: &[u8]) -> Result<(), MeshError> {
        let (name, count) = split_word(rest);
        let number = std::str::from_utf8(count).ok().and_then(|text| text.parse::<u64>().ok());
        let Some(number) = number.filter(|_| !name.is_empty()) else {
            let what = format!("\"element\" needs a name and a whole number, not \"{}\"", word(rest));
            return Err(self.lines.fault(&what));
        };
        if self.elements.len() == ELEMENTS_MAX {
            return Err(self.lines.fault(&format!("there are more than {ELEMENTS_MAX} elements")));
        }
        let name = String::from_utf8_lossy(name).into_owned();
        if self.elements.iter().any(|element| element.name == name) {
            return Err(self.lines.fault(&format!("there is an element \"{}\" already", word(name.as_bytes()))));
        }
        self.elements.push(Element { name, count: number, properties: Vec::new() });
        Ok(())
    }

    fn property(&mut self, rest: &[u8]) -> Result<(), MeshError> {
        let (first, after) = split_word(rest);
        let (shape, name) = if first == b"list" {
            let (count, after) = split_word(after);
            let (item, name) = split_word(after);
            (Shape::List { count: self.kind(count)?, item: self.kind(item)? }, name)
        } else {
            (Shape::One(self.kind(first)?), after)
        };
        let (name, _) = split_word(name);
        if name.is_empty() {
            return Err(self.lines.fault("the property has no name"));
        }
        self.properties += 1;
        if self.properties > PROPERTIES_MAX {
            return Err(self.lines.fault(&format!("there are more than {PROPERTIES_MAX} properties")));
        }
        let property = Property { name: String::from_utf8_lossy(name).into_owned(), shape };
        match self.elements.last_mut() {
            Some(element) => element.properties.push(property),
            None => return Err(self.lines.fault("a property comes before the first element")),
        }
        Ok(())
    }

    fn kind(&self, name: &[u8]) -> Result<Kind, MeshError> {
        let known = "char, uchar, short, ushort, int, uint, float or double";
        Kind::parse(name).ok_or_else(|| self.lines.fault(&format!("the type \"{}\" is not {known}", word(name))))
    }
}

/// The lines of a header, all with the line end of the first.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    number: u64,
    newline: u8,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let end = bytes.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(bytes.len());
        // Only very old files end their lines with a carriage return alone.
        let is_old = bytes[end..].starts_with(b"\r") && !bytes[end..].starts_with(b"\r\n");
        Self { bytes, at: 0, number: 0, newline: if is_old { b'\r' } else { b'\n' } }
    }

    fn next(&mut self) -> Result<&'a [u8], MeshError> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            let what = format!("the PLY file ends after line {} without an \"end_header\"", self.number);
            return Err(MeshError::broken(what));
        }
        self.number += 1;
        let head = &rest[..rest.len().min(LINE_BYTES_MAX + 1)];
        let end = head.iter().position(|&b| b == self.newline).unwrap_or(head.len());
        if end > LINE_BYTES_MAX {
            return Err(self.fault(&format!("it is longer than {LINE_BYTES_MAX} bytes")));
        }
        self.at += rest.len().min(end + 1);
        if self.at > HEADER_BYTES_MAX {
            let what = format!("the PLY header has no \"end_header\" in its first {HEADER_BYTES_MAX} bytes");
            return Err(MeshError::broken(what));
        }
        Ok(&rest[..end])
    }

    fn fault(&self, what: &str) -> MeshError {
        MeshError::broken(format!("line {} of the PLY header: {what}", self.number))
    }
}

/// The first word, and what follows it.
fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
    (&text[..end], text[end..].trim_ascii())
}

/// The name in `TextureFile NAME`, which may have spaces.
pub fn texture_file(comment: &[u8]) -> Option<Vec<u8>> {
    let (keyword, name) = split_word(comment);
    (keyword.eq_ignore_ascii_case(b"TextureFile") && !name.is_empty()).then(|| name.to_vec())
}
