//! The parsing of one corner of an OBJ face: `v`, `v/vt`, `v//vn` or `v/vt/vn`. Indices count from
//! 1, or back from the line if they are negative; here they become zero-based.

/// The index of an attribute that a corner does not have.
pub const MISSING: u32 = u32::MAX;

/// Numbers of vertices, texture coordinates and normals before the line: relative indices count
/// back from there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// `v` lines.
    pub v: u64,
    /// `vt` lines.
    pub vt: u64,
    /// `vn` lines.
    pub vn: u64,
}

impl std::ops::Add for Counts {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self { v: self.v + more.v, vt: self.vt + more.vt, vn: self.vn + more.vn }
    }
}

/// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`; also with empty ends, as in `v//`. Gives zero-based
/// indices, [`MISSING`] for what the corner lacks. The error says what is wrong with the word.
pub fn parse_corner(word: &[u8], counts: Counts) -> Result<[u32; 3], String> {
    let mut parts = word.split(|&b| b == b'/');
    let mut next = |what: &str, count: u64| match parts.next() {
        None | Some(b"") => Ok(None),
        Some(digits) => resolve(digits, count).map(Some).map_err(|why| format!("the {what} index {why}")),
    };
    let v = next("vertex", counts.v)?.ok_or("a corner has no vertex index")?;
    let vt = next("texture coordinate", counts.vt)?;
    let vn = next("normal", counts.vn)?;
    if parts.next().is_some() {
        return Err(format!("the corner \"{}\" has more than three indices", show(word)));
    }
    Ok([v, vt.unwrap_or(MISSING), vn.unwrap_or(MISSING)])
}

/// From the file's one-based or negative index to a zero-based one.
fn resolve(digits: &[u8], count: u64) -> Result<u32, String> {
    let index: i64 = std::str::from_utf8(digits)
        .ok()
        .and_then(|d| d.parse().ok())
        .ok_or_else(|| format!("\"{}\" is not a whole number", show(digits)))?;
    if index == 0 {
        return Err("is 0, and OBJ counts from 1".into());
    }
    let zero_based = if index > 0 {
        Some(index.unsigned_abs() - 1)
    } else {
        let before = count.checked_sub(index.unsigned_abs());
        Some(before.ok_or_else(|| format!("{index} is out of range: only {count} come before this line"))?)
    };
    let zero_based = zero_based.and_then(|index| u32::try_from(index).ok()).filter(|index| *index != MISSING);
    zero_based.ok_or_else(|| format!("{index} is out of range"))
}

/// A short, printable form of some bytes of the file.
pub fn show(bytes: &[u8]) -> String {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]);
    head.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}
