//! MTL, the material library of OBJ, read line by line. Only materials that the OBJ file names are
//! kept, so that others take no memory. In the kept ones, lines with broken values and most
//! textures that are not drawn are counted for warnings. Other lines are skipped.

use super::lines::{Lines, uncommented};
use super::map::{Map, number, split_word};
use crate::import::MeshError;
use crate::import::context::Context;
use rapidhash::RapidHashMap;

/// Letters of a keyword that are looked at: more than any keyword has that is read.
const KEYWORD_MAX: usize = 12;

/// The statements about one material. None: not stated.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// `Kd`, as displayed.
    pub diffuse: Option<[f64; 3]>,
    /// `Ke`, as displayed.
    pub emissive: Option<[f64; 3]>,
    /// `d`, 0 to 1.
    pub opacity: Option<f64>,
    /// `Tr`.
    pub transparency: Option<f64>,
    /// `Pm`.
    pub metallic: Option<f64>,
    /// `Pr`.
    pub roughness: Option<f64>,
    /// `Ns`, the exponent of the highlight.
    pub exponent: Option<f64>,
    /// `map_Kd`.
    pub diffuse_map: Option<Map>,
    /// `map_Ke`.
    pub emissive_map: Option<Map>,
    /// `map_d`.
    pub opacity_map: Option<Map>,
    /// `norm` or `map_Kn`.
    pub normal_map: Option<Map>,
}

/// Counts of skipped lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkippedLines {
    /// `bump` and its like.
    pub bumps: u64,
    /// Textures that are not drawn: `map_Ks`, `map_Pr` ...
    pub maps: u64,
    /// Lines with broken numbers.
    pub broken: u64,
}

/// Reads one library. `numbers` maps wanted names to places in `found`. The first definition of a
/// name counts, so filled places stay.
pub fn read<T: Copy>(
    bytes: &[u8],
    numbers: &RapidHashMap<&[u8], usize>,
    found: &mut [Option<(Material, T)>],
    library: T,
    cx: &mut Context<'_>,
) -> Result<SkippedLines, MeshError> {
    // A continued line is joined in memory.
    cx.budget.spend("a material library", bytes.len() as u64, 1)?;
    let mut passed = SkippedLines::default();
    let mut current = None;
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        if lines.number.is_multiple_of(4096) {
            cx.deadline.check()?;
        }
        let (keyword, rest) = split_word(line.trim_ascii());
        if keyword.eq_ignore_ascii_case(b"newmtl") {
            current = numbers.get(uncommented(rest)).copied().filter(|&number| found[number].is_none());
            if let Some(number) = current {
                found[number] = Some((Material::default(), library));
            }
        } else if let Some((material, _)) = current.and_then(|number: usize| found[number].as_mut()) {
            material.statement(keyword, rest, &mut passed);
        }
    }
    Ok(passed)
}

impl Material {
    /// The opacity, and true if `Tr` was ignored.
    ///
    /// `Tr` is 1 - `d` by most accounts, but some exporters (MeshLab for one) write opacity there.
    /// A material that `Tr` alone makes fully invisible is one of theirs.
    pub fn alpha(&self) -> (f64, bool) {
        match (self.opacity, self.transparency) {
            (Some(opacity), _) => (opacity, false),
            (None, Some(transparency)) if transparency < 1.0 => (1.0 - transparency, false),
            (None, Some(_)) => (1.0, true),
            (None, None) => (1.0, false),
        }
    }

    fn statement(&mut self, keyword: &[u8], rest: &[u8], passed: &mut SkippedLines) {
        let keyword = &keyword[..keyword.len().min(KEYWORD_MAX)];
        let mut lower = [0; KEYWORD_MAX];
        let lower = &mut lower[..keyword.len()];
        lower.copy_from_slice(keyword);
        lower.make_ascii_lowercase();
        let done = match &*lower {
            b"kd" => set(&mut self.diffuse, color(rest)),
            b"ke" => set(&mut self.emissive, color(rest)),
            b"d" => set(&mut self.opacity, unit(rest.strip_prefix(b"-halo").unwrap_or(rest))),
            b"tr" => set(&mut self.transparency, unit(rest)),
            b"pm" => set(&mut self.metallic, unit(rest)),
            b"pr" => set(&mut self.roughness, unit(rest)),
            b"ns" => set(&mut self.exponent, number(split_word(rest).0).map(|n| n.max(0.0))),
            b"map_kd" => set(&mut self.diffuse_map, Map::parse(rest)),
            b"map_ke" => set(&mut self.emissive_map, Map::parse(rest)),
            b"map_d" => set(&mut self.opacity_map, Map::parse(rest)),
            b"norm" | b"map_kn" => set(&mut self.normal_map, Map::parse(rest)),
            b"bump" | b"map_bump" => {
                passed.bumps += 1;
                true
            }
            b"map_ka" | b"disp" | b"decal" | b"refl" => true,
            other => {
                passed.maps += u64::from(other.starts_with(b"map_"));
                true
            }
        };
        passed.broken += u64::from(!done);
    }
}

/// Keeps a value; whether there is one.
fn set<T>(place: &mut Option<T>, value: Option<T>) -> bool {
    let is_some = value.is_some();
    if is_some {
        *place = value;
    }
    is_some
}

fn unit(text: &[u8]) -> Option<f64> {
    number(split_word(text.trim_ascii_start()).0).map(|n| n.clamp(0.0, 1.0))
}

/// Three numbers, or one for all three. Spectral curves and XYZ are not read.
fn color(text: &[u8]) -> Option<[f64; 3]> {
    let (first, rest) = split_word(text);
    let red = number(first)?.max(0.0);
    let (second, rest) = split_word(rest);
    if second.is_empty() || second.starts_with(b"#") {
        return Some([red; 3]);
    }
    Some([red, number(second)?.max(0.0), number(split_word(rest).0)?.max(0.0)])
}
