//! The corners of an `f` line.

/// Zero-based indices of one corner. None where the file has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corner {
    /// Position.
    pub v: u64,
    /// Texture coordinate.
    pub vt: Option<u64>,
    /// Normal.
    pub vn: Option<u64>,
}

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

/// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`; also with empty ends, as in `v//`. The error says what
/// is wrong with the word.
pub fn parse_corner(word: &[u8], counts: Counts) -> Result<Corner, String> {
    let mut parts = word.split(|&b| b == b'/');
    let mut next = |what: &str, count: u64| match parts.next() {
        None | Some(b"") => Ok(None),
        Some(digits) => resolve(digits, count).map(Some).map_err(|why| format!("the {what} index {why}")),
    };
    let v = next("vertex", counts.v)?.ok_or("a corner has no vertex index")?;
    let corner = Corner { v, vt: next("texture coordinate", counts.vt)?, vn: next("normal", counts.vn)? };
    if parts.next().is_some() {
        return Err(format!("the corner \"{}\" has more than three indices", show(word)));
    }
    Ok(corner)
}

/// From the file's one-based or negative index to a zero-based one.
fn resolve(digits: &[u8], count: u64) -> Result<u64, String> {
    let index: i64 = std::str::from_utf8(digits)
        .ok()
        .and_then(|d| d.parse().ok())
        .ok_or_else(|| format!("\"{}\" is not a whole number", show(digits)))?;
    match index {
        0 => Err("is 0, and OBJ counts from 1".into()),
        // tobj multiplies indices by 3 and 2 without a check.
        4_294_967_296.. => Err(format!("{index} is out of range")),
        1.. => Ok(index.unsigned_abs() - 1),
        _ => count
            .checked_sub(index.unsigned_abs())
            .ok_or_else(|| format!("{index} is out of range: only {count} come before this line")),
    }
}

/// A short, printable form of some bytes of the file.
pub fn show(bytes: &[u8]) -> String {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(40)]);
    head.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect()
}

/// Writes an `f` line, with texture coordinates and normals as the last argument says.
pub fn write_face(out: &mut Vec<u8>, corners: &[Corner], (vt, vn): (bool, bool)) {
    out.push(b'f');
    for corner in corners {
        out.push(b' ');
        write_index(out, corner.v);
        if vt || vn {
            out.push(b'/');
        }
        if let Some(index) = corner.vt.filter(|_| vt) {
            write_index(out, index);
        }
        if let Some(index) = corner.vn.filter(|_| vn) {
            out.push(b'/');
            write_index(out, index);
        }
    }
    out.push(b'\n');
}

fn write_index(out: &mut Vec<u8>, index: u64) {
    let mut digits = [0_u8; 20];
    let mut at = digits.len();
    let mut rest = index + 1;
    while rest > 0 {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
    out.extend_from_slice(&digits[at..]);
}
