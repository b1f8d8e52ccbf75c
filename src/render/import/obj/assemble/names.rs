//! The material names of an OBJ text: its `usemtl` names, numbered from 1 in the order of first
//! use. Each part of the text, parsed on its own, begins with the last material of the part before
//! it. The number 0 is for faces before the first `usemtl`.

use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::obj::parse::{Group, Part};
use rapidhash::RapidHashMap;

/// Lines between two deadline checks.
const LINES_PER_POLL: usize = 65_536;

/// Names, and the numbers of the names of each part.
#[derive(Debug, Default)]
pub struct Names {
    /// The names.
    pub all: Vec<Vec<u8>>,
    of_parts: Vec<OfPart>,
}

#[derive(Debug)]
struct OfPart {
    /// The material before the part's first `usemtl`.
    inherited: u32,
    /// One for each of its `usemtl` lines.
    numbers: Vec<u32>,
}

impl Names {
    /// Numbers the names of some parts from 1; 0 is for faces before the first `usemtl`.
    pub fn of(parts: &[Part<'_>], cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let mut names = Self::default();
        let mut known: RapidHashMap<&[u8], u32> = RapidHashMap::default();
        let mut inherited = 0;
        for part in parts {
            let mut numbers = Vec::with_capacity(part.materials.len());
            for (i, name) in part.materials.iter().enumerate() {
                if i % LINES_PER_POLL == 0 {
                    cx.deadline.check()?;
                }
                let number = match known.get(name.as_ref()) {
                    Some(&number) => number,
                    None => {
                        cx.budget.spend("the materials of the OBJ file", 2048 + 4 * name.len() as u64, 1)?;
                        names.all.push(name.to_vec());
                        known.insert(name, names.all.len() as u32);
                        names.all.len() as u32
                    }
                };
                numbers.push(number);
            }
            let last = numbers.last().copied().unwrap_or(inherited);
            names.of_parts.push(OfPart { inherited, numbers });
            inherited = last;
        }
        Ok(names)
    }

    /// The material of a group of the part numbered `part`.
    pub fn material(&self, part: usize, group: &Group) -> u32 {
        let part = &self.of_parts[part];
        group.material.map_or(part.inherited, |index| part.numbers[index as usize])
    }
}
