//! Lines of numbers: vertices, their colours, normals and texture coordinates.

use super::super::face::show;
use super::Cleaner;
use crate::import::{MeshError, text};

impl Cleaner<'_, '_> {
    /// Writes a position, with its colour or its weight.
    pub(crate) fn vertex<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), MeshError> {
        let mut all: [&[u8]; 7] = [b""; 7];
        let mut count = 0;
        for word in words.take(7) {
            all[count] = word;
            count += 1;
        }
        self.numbers(b"v", all[..count].iter().copied(), 3)?;
        let color = Some(&all[3..6]).filter(|c| count >= 6 && c.iter().all(|w| number(w).is_some()));
        let colored = *self.colored.get_or_insert(color.is_some());
        self.skipped.colors += u64::from(colored != color.is_some());
        // Six or seven numbers are a position and a colour. Four are x y z w; tobj divides by w.
        let more: &[&[u8]] = match color {
            Some(color) if colored => color,
            None if colored => &[b"1", b"1", b"1"],
            _ if count == 4 && number(all[3]).is_some_and(|w| w != 0.0) => &all[3..4],
            _ => &[],
        };
        if !more.is_empty() {
            self.unpaid_bytes += 48 + 16;
            self.out.pop();
            for word in more {
                self.out.push(b' ');
                self.out.extend_from_slice(word);
            }
            self.out.push(b'\n');
        }
        Ok(())
    }

    /// Writes a line with exactly `count` numbers; `tobj` parses them.
    pub(crate) fn numbers<'w>(
        &mut self,
        keyword: &[u8],
        mut words: impl Iterator<Item = &'w [u8]>,
        count: usize,
    ) -> Result<(), MeshError> {
        self.out.extend_from_slice(keyword);
        for i in 0..count {
            let word = match words.next() {
                Some(word) if text::is_c_nan(word) => b"nan",
                Some(word) if word.is_ascii() => word,
                // A one-dimensional texture coordinate is legal.
                None if count == 2 && i == 1 => b"0",
                other => {
                    let given = other.map_or(format!("it has {i}"), |w| format!("\"{}\" is none", show(w)));
                    return Err(self.broken(&format!("\"{}\" needs {count} numbers, and {given}", show(keyword))));
                }
            };
            self.out.push(b' ');
            self.out.extend_from_slice(word);
        }
        self.out.push(b'\n');
        Ok(())
    }
}

fn number(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok().filter(|v: &f64| v.is_finite())
}
