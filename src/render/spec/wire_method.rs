//! The table of wire methods, which are the ways to draw lines along the mesh's edges. The words of
//! requests, their schema, the quality selection and the accuracy benchmark follow from it;
//! CONTRIBUTING.md lists what else a new method needs.

use super::words::Words;

/// A method of drawing wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WireMethod {
    /// Full width in pixels by exact box-filter coverage.
    Exact,
    /// `min_i smoothstep(t d_i, (t + s) d_i, b_i)` with `d = fwidth(b)`.
    Fwidth,
    /// `smoothstep(t d, (t + s) d, m)` with `m = min_i b_i` and `d = fwidth(m)`: shows artefacts
    /// near corners.
    FwidthMin,
    /// `smoothstep(0, 0.1 t, min_i b_i)`: the width is proportional to the triangle's size.
    Barycentric,
    /// Coloured where any `b_i < 0.02 t`: no smoothing at all.
    Threshold,
}

/// One row of [`WIRE_METHODS`].
#[derive(Debug)]
pub struct WireMethodInfo {
    /// The method.
    pub method: WireMethod,
    /// Its name in requests, in answers and in the table of measured errors.
    pub name: &'static str,
    /// A few words for the schema.
    pub about: &'static str,
    /// The unit of its thickness, which also decides the code that draws it.
    pub unit: ThicknessUnit,
}

/// The unit in which a wire method measures thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThicknessUnit {
    /// Pixels. Drawn as lines of exact width: `plan/lines`, `backend/*/lines`.
    Pixels,
    /// Multiples of `|db/dx| + |db/dy|`, which is one pixel for an edge along an axis. Drawn while
    /// the surface is shaded: `plan/surface/materials.rs`, `wire.rs` and `wire.wgsl` under
    /// `surface`.
    Derivatives,
    /// Share of the triangle's height. At the given share, the wire's coverage is one half. Drawn
    /// while the surface is shaded.
    TriangleHeight(f64),
}

/// Every wire method.
pub const WIRE_METHODS: &[WireMethodInfo] = &[
    WireMethodInfo {
        method: WireMethod::Exact,
        name: "exact",
        about: "true width by coverage",
        unit: ThicknessUnit::Pixels,
    },
    WireMethodInfo {
        method: WireMethod::Fwidth,
        name: "fwidth",
        about: "smoothstep in multiples of |db/dx| + |db/dy|, for each coordinate",
        unit: ThicknessUnit::Derivatives,
    },
    WireMethodInfo {
        method: WireMethod::FwidthMin,
        name: "fwidth-min",
        about: "likewise, for the smallest coordinate",
        unit: ThicknessUnit::Derivatives,
    },
    WireMethodInfo {
        method: WireMethod::Barycentric,
        name: "barycentric",
        about: "width as a share of the triangle",
        unit: ThicknessUnit::TriangleHeight(0.05),
    },
    WireMethodInfo {
        method: WireMethod::Threshold,
        name: "threshold",
        about: "no smoothing",
        unit: ThicknessUnit::TriangleHeight(0.02),
    },
];

impl WireMethod {
    /// Its row of the table.
    pub fn info(self) -> &'static WireMethodInfo {
        WIRE_METHODS.iter().find(|row| row.method == self).unwrap_or(&WIRE_METHODS[0])
    }

    /// True if a width in pixels can be translated into its thickness.
    pub fn has_pixel_width(self) -> bool {
        !matches!(self.info().unit, ThicknessUnit::TriangleHeight(_))
    }
}

impl Words for WireMethod {
    const ALL: &'static [(&'static str, Self)] = {
        const WORDS: [(&str, WireMethod); WIRE_METHODS.len()] = {
            let mut words = [("", WireMethod::Exact); WIRE_METHODS.len()];
            let mut row = 0;
            while row < words.len() {
                words[row] = (WIRE_METHODS[row].name, WIRE_METHODS[row].method);
                row += 1;
            }
            words
        };
        &WORDS
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::words::{word_for, words_of};

    #[test]
    fn every_method_has_one_row() {
        assert_eq!(words_of::<WireMethod>(), ["exact", "fwidth", "fwidth-min", "barycentric", "threshold"]);
        for row in WIRE_METHODS {
            assert_eq!((row.method.info().name, word_for(row.method)), (row.name, row.name));
        }
        let in_pixels: Vec<&str> =
            WIRE_METHODS.iter().filter(|row| row.method.has_pixel_width()).map(|row| row.name).collect();
        assert_eq!(in_pixels, ["exact", "fwidth", "fwidth-min"]);
    }
}
