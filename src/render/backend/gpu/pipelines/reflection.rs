//! The buffers that a kernel's code uses, and the bits of the pipeline key (features of a picture) that it asks for,
//! both found by reading the code as text.
//!
//! Only functions that the entry point calls count, however indirectly. The search relies on the layout of shaders/:
//! what lies outside of functions begins at the start of a line, and so do functions and their closing brackets.

use std::collections::{HashMap, HashSet};

use super::{Access, Slot};

/// A buffer of group 1 and the kernel's access to it.
pub type Binding = (Slot, Access);

/// The buffers and bits that a kernel's code uses.
#[derive(Debug, PartialEq)]
pub struct Reflection {
    /// Buffers of group 1.
    pub buffers: Vec<Binding>,
    /// Bits of the key that it asks for with `has`: there is a pipeline for every combination in use.
    pub key_bits: u32,
}

impl Reflection {
    /// Reads the code of a kernel with this entry point.
    pub fn of(entry: &str, source: &str) -> Self {
        let (functions, words_used) = called_functions(entry, source);
        let declared = source.lines().filter_map(declared_buffer);
        let buffers = declared.filter(|(name, _)| words_used.contains(name)).map(|(_, binding)| binding).collect();
        let flags = functions.iter().flat_map(|function| function.split("has(").skip(1));
        let flags: HashSet<_> = flags.filter_map(|call| call.split(')').next()).flat_map(words).collect();
        let bits = source.lines().filter_map(constant).filter(|(name, _)| flags.contains(name));
        let key_bits = bits.fold(0, |all, (_, bit)| all | bit);
        Self { buffers, key_bits }
    }
}

/// The function `entry` and those that it calls, however indirectly: the text of each, and their words.
fn called_functions<'a>(entry: &'a str, source: &'a str) -> (Vec<&'a str>, HashSet<&'a str>) {
    let functions = source.split("\nfn ").skip(1).filter_map(|text| text.split("\n}").next());
    let functions: HashMap<_, _> = functions.filter_map(|text| Some((text.split_once('(')?.0, text))).collect();
    let mut called: Vec<_> = functions.get(entry).copied().into_iter().collect();
    let mut seen = HashSet::from([entry]);
    let mut next = 0;
    while let Some(function) = called.get(next).copied() {
        let new = words(function).filter(|word| seen.insert(word));
        called.extend(new.filter_map(|word| functions.get(word)));
        next += 1;
    }
    (called, seen)
}

/// The words of some code, without its comments.
fn words(code: &str) -> impl Iterator<Item = &str> {
    let lines = code.lines().filter_map(|line| line.split("//").next());
    lines.flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric() && c != '_'))
}

/// The buffer that a line of code declares, and its name there.
fn declared_buffer(line: &str) -> Option<(&str, Binding)> {
    let (number, rest) = line.strip_prefix("@group(1) @binding(")?.split_once(") var<storage, ")?;
    let (access, rest) = rest.split_once("> ")?;
    let slot = bytemuck::checked::try_cast(number.parse::<u32>().ok()?).ok()?;
    let access = if access == "read" { Access::Read } else { Access::ReadWrite };
    Some((rest.split_once(':')?.0, (slot, access)))
}

/// The unsigned constant that a line of code defines: name and value.
pub fn constant(line: &str) -> Option<(&str, u32)> {
    let (name, value) = line.strip_prefix("const ")?.strip_suffix("u;")?.split_once(": u32 = ")?;
    let value = value.strip_prefix("0x").map_or_else(|| value.parse(), |digits| u32::from_str_radix(digits, 16));
    Some((name, value.ok()?))
}
