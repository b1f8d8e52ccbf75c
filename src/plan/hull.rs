//! The inverted hull: back faces alone, each vertex pushed out along its normal.

use std::borrow::Cow;

/// The triangles with [`roles::HULL`](super::roles::HULL), pushed out.
#[derive(Debug)]
pub struct HullPass<'a> {
    /// Premultiplied linear RGBA, by material index; one where all are the same.
    pub colors: Vec<[f32; 4]>,
    /// A unit normal a position.
    pub normals: Cow<'a, [[f32; 3]]>,
    /// How far.
    pub offset: HullOffset,
    /// How far each position moves, in the unit of `offset`, where parts differ; else empty, and all move by `offset`.
    pub amounts: Vec<f32>,
}

/// How far a hull vertex moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HullOffset {
    /// Along the normal, in units of the box.
    Object(f32),
    /// On screen along the projected normal, in pixels.
    Px(f32),
}
