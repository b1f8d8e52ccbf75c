//! The stand-in for `scene.rs` in a build without the feature `fbx`. It refuses every FBX file,
//! with an error that names the feature.

use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::raw::RawMesh;

/// Refuses: this build has no parser.
pub fn read(_: &[u8], _: &mut Context<'_>) -> Result<RawMesh, MeshError> {
    Err(MeshError::missing_feature("the file is FBX", "fbx"))
}
