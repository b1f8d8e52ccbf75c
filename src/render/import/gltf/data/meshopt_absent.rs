//! The stand-in for `meshopt.rs` in a build without the feature `meshopt`. It refuses buffer views
//! that meshoptimizer has packed, with an error that names the feature.

use crate::guard::Panicked;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::document::schema::Meshopt;

/// What became of a view's bytes.
pub type Unpacked = Result<Option<Vec<u8>>, Panicked>;

/// Refuses: this build has no decoder.
pub fn decode(
    index: usize,
    _: &Meshopt,
    _: bool,
    _: &[u8],
    _: u64,
    _: Option<Unpacked>,
    _: &mut Context<'_>,
) -> Result<Vec<u8>, MeshError> {
    let what = format!("buffer view {index} is compressed by meshoptimizer");
    Err(MeshError::missing_feature(&what, "meshopt"))
}
