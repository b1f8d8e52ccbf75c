//! The cameras of a glTF file's default scene. A broken one is left out with a warning, because
//! most pictures use none of them.

use crate::import::affine::Affine;
use crate::import::context::Context;
use crate::import::gltf::document::lists;
use crate::import::gltf::document::lists::{Lists, entry};
use crate::import::{MeshError, text};
use crate::mesh::material::{FileCamera, FileLens};
use crate::mesh::vector::cross;
use crate::warning::Warning;
use std::collections::BTreeMap;

/// A node that shows a camera.
#[derive(Debug)]
pub struct Placed {
    /// Index of the camera.
    pub camera: usize,
    /// The node's name.
    pub name: Option<String>,
    /// Transform from node to scene space.
    pub transform: Affine,
}

/// Reads the cameras of the default scene. A broken one is left out with a warning, because most
/// pictures use none of them.
///
/// Each is parsed once, even where many nodes refer to it.
pub fn cameras(
    placed: &[Placed],
    lists: &Lists<'_>,
    warnings: &mut Vec<Warning>,
    cx: &mut Context<'_>,
) -> Result<Vec<FileCamera>, MeshError> {
    let mut known: BTreeMap<usize, Result<Known, MeshError>> = BTreeMap::new();
    let mut cameras = Vec::new();
    for place in placed {
        cx.deadline.check()?;
        let index = place.camera;
        if let std::collections::btree_map::Entry::Vacant(new) = known.entry(index) {
            let json_bytes = lists.cameras.get(index).map_or(0, |json| json.get().len());
            cx.budget.spend("a camera's description", json_bytes as u64 + 1024, 1)?;
            new.insert(parse(index, lists));
        }
        let camera = match known.get(&index) {
            Some(Ok(known)) => show(place, known),
            Some(Err(error)) => Err(error.clone()),
            None => continue,
        };
        match camera {
            Ok(camera) => cameras.push(camera),
            Err(error) => {
                crate::import::gltf::warn_once(warnings, "camera_ignored", format!("a camera is left out: {error}"))
            }
        }
    }
    Ok(cameras)
}

/// The part of a camera that does not depend on its node.
struct Known {
    name: String,
    lens: FileLens,
}

fn parse(index: usize, lists: &Lists<'_>) -> Result<Known, MeshError> {
    let json: lists::Camera = entry("camera", &lists.cameras, index)?;
    let lens = match (&json.perspective, &json.orthographic) {
        (Some(lens), _) if lens.yfov > 0.0 && lens.yfov < std::f64::consts::PI => {
            FileLens::Perspective { fov_deg: lens.yfov.to_degrees() }
        }
        (Some(_), _) => return Err(broken(index, "has a field of view that is not between 0 and half a turn")),
        (None, Some(lens)) if lens.ymag != 0.0 && (2.0 * lens.ymag).is_finite() => {
            FileLens::Orthographic { height: 2.0 * lens.ymag.abs() }
        }
        (None, Some(_)) => return Err(broken(index, "has no height")),
        (None, None) => return Err(broken(index, "has neither a perspective nor an orthographic lens")),
    };
    Ok(Known { name: text::name(json.name.as_deref().unwrap_or_default()), lens })
}

fn show(place: &Placed, known: &Known) -> Result<FileCamera, MeshError> {
    let index = place.camera;
    let eye = place.transform.point([0.0; 3]);
    let axes = axes(&place.transform).ok_or_else(|| broken(index, "is scaled to nothing"))?;
    if !eye.iter().all(|c| c.is_finite()) {
        return Err(broken(index, "is infinitely far away"));
    }
    let name = Some(&known.name).filter(|name| !name.is_empty()).or(place.name.as_ref());
    Ok(FileCamera { name: name.cloned().unwrap_or_default(), eye, axes, lens: known.lens })
}

fn broken(index: usize, what: &str) -> MeshError {
    MeshError::broken(format!("camera {index} of the glTF file {what}"))
}

/// Cameras look along -Z with +Y up. Scales and mirrorings of a node do not reach the picture.
fn axes(transform: &Affine) -> Option<[[f64; 3]; 3]> {
    let [_, up, back] = transform.columns();
    let back = unit(back)?;
    let right = unit(cross(unit(up)?, back))?;
    Some([right, cross(back, right), back])
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let largest = v.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let v = v.map(|c| c / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length >= 1.0 && length.is_finite()).then(|| v.map(|c| c / length))
}
