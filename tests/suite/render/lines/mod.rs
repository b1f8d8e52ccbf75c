//! Lines: their formulas, holes, looks, borders and limits, and line and point primitives.

pub mod borders;
pub mod floors;
pub mod formulas;
pub mod gaps;
pub mod holes;
pub mod limits;
pub mod looks;
pub mod points;
pub mod primitives;
pub mod shortcuts;
pub mod tinted;
