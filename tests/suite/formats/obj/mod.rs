//! OBJ and its material library.

pub mod basics;
pub mod mtl;
pub mod polygons;
pub mod wild;
