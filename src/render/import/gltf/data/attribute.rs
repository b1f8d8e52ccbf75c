//! The types that an accessor may have, by its use: the element type, the component type, and
//! whether its integers are normalised (stand for 0 to 1, or for -1 to 1). They follow glTF 2.0,
//! 3.7.2.1 (attributes), 3.7.3 (skins), 3.11 (animations), and EXT_mesh_gpu_instancing.
//! KHR_mesh_quantization adds small integers.

use crate::import::MeshError;

/// `accessor.type`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One component.
    Scalar,
    /// Two.
    Vec2,
    /// Three.
    Vec3,
    /// Four.
    Vec4,
    /// A 4 x 4 matrix, by columns.
    Mat4,
}

impl Kind {
    /// From its name in the document. Matrices of 2 x 2 and 3 x 3 are not read.
    pub fn of(name: &str) -> Option<Self> {
        Some(match name {
            "SCALAR" => Self::Scalar,
            "VEC2" => Self::Vec2,
            "VEC3" => Self::Vec3,
            "VEC4" => Self::Vec4,
            "MAT4" => Self::Mat4,
            _ => return None,
        })
    }

    /// Numbers per element.
    pub fn components(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 => 4,
            Self::Mat4 => 16,
        }
    }
}

/// `accessor.componentType`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// BYTE
    I8,
    /// UNSIGNED_BYTE
    U8,
    /// SHORT
    I16,
    /// UNSIGNED_SHORT
    U16,
    /// UNSIGNED_INT
    U32,
    /// FLOAT
    F32,
}

impl Component {
    /// From its number in the document.
    pub fn of(number: usize) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// Its size.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number in its bytes. A normalised integer is divided by the largest value of its type
    /// and clamped to at least -1.
    pub fn decode(self, b: &[u8], normalised: bool) -> f64 {
        let (value, largest) = match (self, b) {
            (Self::F32, &[a, b, c, d]) => return f64::from(f32::from_le_bytes([a, b, c, d])),
            (Self::I8, &[a]) => (f64::from(a.cast_signed()), 127.0),
            (Self::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), 32767.0),
            (Self::U8, _) => (f64::from(decode_unsigned(b)), 255.0),
            (Self::U16, _) => (f64::from(decode_unsigned(b)), 65535.0),
            _ => (f64::from(decode_unsigned(b)), 4294967295.0),
        };
        if normalised { (value / largest).max(-1.0) } else { value }
    }
}

/// An unsigned integer of 1, 2 or 4 bytes.
pub fn decode_unsigned(b: &[u8]) -> u32 {
    match *b {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    }
}

/// The allowed types of an accessor for one use.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// The name of the use in errors.
    pub name: &'static str,
    kinds: &'static [Kind],
    /// Allowed component types, each with its normalisation.
    plain: &'static [(Component, bool)],
    /// Types that KHR_mesh_quantization adds.
    quantised: &'static [(Component, bool)],
}

impl Rule {
    /// Fails if an accessor breaks the rule. `what` names the accessor.
    pub fn check(&self, what: &str, kind: Kind, form: (Component, bool), is_quantised: bool) -> Result<(), MeshError> {
        let fails = |is: String| {
            Err(MeshError::broken(format!("{what} of the glTF file is {is}, which {} cannot be", self.name)))
        };
        if !self.kinds.contains(&kind) {
            return fails(format!("{kind:?}"));
        }
        if self.plain.contains(&form) || is_quantised && self.quantised.contains(&form) {
            return Ok(());
        }
        let normalised = if form.1 { "normalised " } else { "" };
        if self.quantised.contains(&form) {
            return fails(format!("{normalised}{:?} in a file that does not use KHR_mesh_quantization", form.0));
        }
        fails(format!("{normalised}{:?}", form.0))
    }
}

const FLOAT: (Component, bool) = (Component::F32, false);
const BYTES: [(Component, bool); 2] = [(Component::I8, false), (Component::I8, true)];
const SHORTS: [(Component, bool); 2] = [(Component::I16, false), (Component::I16, true)];
const UNIT_COLORS: &[(Component, bool)] = &[FLOAT, (Component::U8, true), (Component::U16, true)];
const UNIT_NORMALS: &[(Component, bool)] = &[(Component::I8, true), (Component::I16, true)];
const UNIT_INTEGERS: &[(Component, bool)] =
    &[FLOAT, (Component::I8, true), (Component::U8, true), (Component::I16, true), (Component::U16, true)];
const SMALL: &[(Component, bool)] = &[
    BYTES[0],
    BYTES[1],
    SHORTS[0],
    SHORTS[1],
    (Component::U8, false),
    (Component::U8, true),
    (Component::U16, false),
    (Component::U16, true),
];

const fn rule(
    name: &'static str,
    kinds: &'static [Kind],
    plain: &'static [(Component, bool)],
    quantised: &'static [(Component, bool)],
) -> Rule {
    Rule { name, kinds, plain, quantised }
}

pub const POSITION: Rule = rule("a POSITION", &[Kind::Vec3], &[FLOAT], SMALL);
pub const NORMAL: Rule = rule("a NORMAL", &[Kind::Vec3], &[FLOAT], UNIT_NORMALS);
pub const TEXCOORD: Rule = rule("a TEXCOORD", &[Kind::Vec2], UNIT_COLORS, SMALL);
pub const COLOR: Rule = rule("a COLOR", &[Kind::Vec3, Kind::Vec4], UNIT_COLORS, &[]);
pub const JOINTS: Rule =
    rule("a list of joints", &[Kind::Vec4], &[(Component::U8, false), (Component::U16, false)], &[]);
pub const WEIGHTS: Rule = rule("a list of weights", &[Kind::Vec4], UNIT_COLORS, &[]);
pub const INDICES: Rule = rule(
    "a list of vertex indices",
    &[Kind::Scalar],
    &[(Component::U8, false), (Component::U16, false), (Component::U32, false)],
    &[],
);
pub const MORPH_POSITION: Rule =
    rule("a POSITION of a morph target", &[Kind::Vec3], &[FLOAT], &[BYTES[0], BYTES[1], SHORTS[0], SHORTS[1]]);
pub const MORPH_NORMAL: Rule = rule("a NORMAL of a morph target", &[Kind::Vec3], &[FLOAT], UNIT_NORMALS);
pub const INVERSE_BIND_MATRICES: Rule = rule("a list of inverse bind matrices", &[Kind::Mat4], &[FLOAT], &[]);
pub const TIMES: Rule = rule("a list of key times", &[Kind::Scalar], &[FLOAT], &[]);
pub const KEY_VECTORS: Rule = rule("a list of translations or scales", &[Kind::Vec3], &[FLOAT], &[]);
pub const KEY_ROTATIONS: Rule = rule("a list of rotations", &[Kind::Vec4], UNIT_INTEGERS, &[]);
pub const KEY_WEIGHTS: Rule = rule("a list of morph weights", &[Kind::Scalar], UNIT_INTEGERS, &[]);
pub const INSTANCE_VECTORS: Rule = rule("a TRANSLATION or SCALE of instances", &[Kind::Vec3], &[FLOAT], &[]);
pub const INSTANCE_ROTATIONS: Rule =
    rule("a ROTATION of instances", &[Kind::Vec4], &[FLOAT, (Component::I8, true), (Component::I16, true)], &[]);
