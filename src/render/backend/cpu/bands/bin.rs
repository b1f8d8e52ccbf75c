//! Lists of numbered items (edges, or pieces of clipped triangles), one per band. A band is a range
//! of pixel rows that one thread draws at a time.
//!
//! An item is in the list of each band that it touches, but one that touches many bands is listed
//! once for all of them, which saves memory.

/// The items of one chunk, listed per band.
#[derive(Default)]
pub struct Bin {
    by_band: Vec<Vec<u32>>,
    /// Items that touch many bands, with the first and last.
    tall: Vec<(u32, [u32; 2])>,
    /// An item is tall if it touches more bands than this.
    tall_bands: usize,
}

impl Bin {
    /// Empty lists; what touches more than `tall_bands` bands is listed once for all of them.
    pub fn new(bands: usize, tall_bands: usize) -> Self {
        Self { by_band: vec![Vec::new(); bands], tall: Vec::new(), tall_bands }
    }

    /// Adds an item that touches the bands from `first` to `last`.
    pub fn push(&mut self, item: u32, [first, last]: [usize; 2]) {
        if last - first >= self.tall_bands {
            self.tall.push((item, [first as u32, last as u32]));
            return;
        }
        for band in &mut self.by_band[first..=last] {
            band.push(item);
        }
    }

    /// The band's items.
    pub fn items_in(&self, band: usize) -> impl Iterator<Item = u32> {
        let is_here = move |[first, last]: [u32; 2]| (first as usize..=last as usize).contains(&band);
        let tall = self.tall.iter().filter(move |(_, bands)| is_here(*bands)).map(|&(item, _)| item);
        self.by_band.get(band).into_iter().flatten().copied().chain(tall)
    }
}
