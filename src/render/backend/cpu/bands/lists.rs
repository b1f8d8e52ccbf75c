//! Lists of the triangles that touch each band. A band is a range of pixel rows that one thread
//! draws at a time.
//!
//! The lists of all bands lie one after the other in one array, which a counting sort fills.
//! Triangles that touch many bands are in a list of their own, which every band filters: otherwise
//! large ones would take too much memory on a tall picture.

use std::ops::Range;

use crate::backend::cpu::isa::LANES;

/// Triangles that touch more than this many bands are listed once for all of them. Otherwise large ones on a
/// tall picture would take gigabytes of lists.
pub const TALL_BANDS: usize = 4;

/// Triangles that culling leaves, in ascending order of their ids.
#[derive(Default)]
pub struct KeptFaces {
    pub ids: Vec<u32>,
    /// First and last band, as a [`pair`].
    pub spans: Vec<u32>,
    /// The triangles with their boxes; empty for lists of ids alone.
    pub boxed: Vec<BoxedFace>,
}

/// A triangle and its box.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BoxedFace {
    pub id: u32,
    /// First and last column of pixels that may have samples of it, as a [`pair`].
    pub columns: u32,
    /// The same of rows.
    pub rows: u32,
    /// Depth of the nearest corner, which is never NaN.
    pub depth_max: f32,
}

/// Two numbers of 16 bits in one word.
#[inline(always)]
pub fn pair([first, last]: [i32; 2]) -> u32 {
    u32::from(first as u16) | u32::from(last as u16) << 16
}

/// The numbers of a [`pair`].
#[inline(always)]
pub fn unpair(pair: u32) -> [i32; 2] {
    [i32::from(pair as u16 as i16), i32::from((pair >> 16) as u16 as i16)]
}

impl KeptFaces {
    /// Room for so many triangles, and for the lanes of the last group.
    pub fn with_room_for(triangles: usize, has_boxes: bool) -> Self {
        let room = triangles + LANES;
        let boxed = Vec::with_capacity(if has_boxes { room } else { 0 });
        Self { ids: Vec::with_capacity(room), spans: Vec::with_capacity(room), boxed }
    }
}

/// Triangles by band, in one list.
#[derive(Default)]
pub struct BandLists {
    /// Index of each band's first item, then the end of the last band's.
    starts: Vec<u32>,
    /// The items, as ids or with boxes.
    ids: Vec<u32>,
    boxed: Vec<BoxedFace>,
    /// Triangles that touch many bands, each with its first and last band as a [`pair`].
    tall: Vec<(BoxedFace, u32)>,
    /// Every triangle's id once, in ascending order.
    pub all: Vec<u32>,
}

impl BandLists {
    /// Sorts the triangles by band.
    pub fn new(kept: KeptFaces, bands: usize) -> Self {
        let mut lists = Self::default();
        for (i, &span) in kept.spans.iter().enumerate().filter(|(_, span)| is_tall(**span)) {
            let face = BoxedFace { id: kept.ids[i], ..kept.boxed.get(i).copied().unwrap_or_default() };
            lists.tall.push((face, span));
        }
        if kept.boxed.is_empty() {
            (lists.ids, lists.starts) = sorted(&kept.ids, &kept.spans, bands);
        } else {
            (lists.boxed, lists.starts) = sorted(&kept.boxed, &kept.spans, bands);
        }
        lists.all = kept.ids;
        lists.all.shrink_to_fit();
        lists
    }

    /// Ids of the band's triangles. The second list has the tall ones, and all of a list with boxes.
    pub fn items_in(&self, band: usize) -> (&[u32], Vec<u32>) {
        let (boxed, tall) = self.boxed_in(band);
        let others = boxed.iter().chain(&tall).map(|face| face.id).collect();
        (self.ids.get(self.range_of(band)).unwrap_or_default(), others)
    }

    /// The band's triangles with their boxes, for lists that have boxes. The second list has the tall
    /// ones.
    pub fn boxed_in(&self, band: usize) -> (&[BoxedFace], Vec<BoxedFace>) {
        let is_here = |span: u32| (bands_of(span)[0]..=bands_of(span)[1]).contains(&band);
        let tall = self.tall.iter().filter(|(_, span)| is_here(*span)).map(|(face, _)| *face).collect();
        (self.boxed.get(self.range_of(band)).unwrap_or_default(), tall)
    }

    /// True if the band has no triangle.
    pub fn is_empty_in(&self, band: usize) -> bool {
        self.tall.is_empty() && self.range_of(band).is_empty()
    }

    fn range_of(&self, band: usize) -> Range<usize> {
        let at = |i: usize| self.starts.get(i).map_or(0, |&start| start as usize);
        at(band)..at(band + 1)
    }
}

#[inline(always)]
fn bands_of(span: u32) -> [usize; 2] {
    [(span & 0xFFFF) as usize, (span >> 16) as usize]
}

#[inline(always)]
fn is_tall(span: u32) -> bool {
    let [first, last] = bands_of(span);
    last - first >= TALL_BANDS
}

/// A number per band, and one more that is never read.
///
/// Most triangles touch one band, some two. A branch between these cases would often be mispredicted.
/// So each triangle is counted twice: the second time in its last band, or in the number that is
/// never read.
struct PerBand(Vec<u32>);

impl PerBand {
    fn zeros(bands: usize) -> Self {
        Self(vec![0; bands + 1])
    }

    /// Adds 1 to each band of a triangle that is not tall. Calls `each` with the numbers before.
    #[inline(always)]
    fn add(&mut self, span: u32, mut each: impl FnMut(u32)) {
        let [first, last] = bands_of(span);
        let number = self.0[first];
        each(number);
        self.0[first] = number + 1;
        for band in first + 1..last {
            each(self.0[band]);
            self.0[band] += 1;
        }
        let vain = self.0.len() - 1;
        let (band, is_other) = if last > first { (last, true) } else { (vain, false) };
        let other = self.0[band];
        each(if is_other { other } else { number });
        self.0[band] = other.wrapping_add(1);
    }
}

/// Calls `each` for each index below `len`, in turns for one of the first half and one of the second.
/// The first argument is the half, 0 or 1. If each half has its own numbers, additions of the two do
/// not wait for each other.
#[inline(always)]
fn in_halves(len: usize, mut each: impl FnMut(usize, usize)) {
    let half = len / 2;
    for i in 0..len - half {
        for (k, [first, end]) in [[0, half], [half, len]].into_iter().enumerate() {
            if first + i < end {
                each(k, first + i);
            }
        }
    }
}

/// The items sorted by band, and the index of each band's first item.
fn sorted<T: Copy + Default>(items: &[T], spans: &[u32], bands: usize) -> (Vec<T>, Vec<u32>) {
    let mut counts = [PerBand::zeros(bands), PerBand::zeros(bands)];
    in_halves(spans.len(), |half, i| {
        if !is_tall(spans[i]) {
            counts[half].add(spans[i], |_| ());
        }
    });
    let mut starts = vec![0; bands + 1];
    let mut places = [PerBand::zeros(bands), PerBand::zeros(bands)];
    for band in 0..bands {
        places[0].0[band] = starts[band];
        places[1].0[band] = starts[band] + counts[0].0[band];
        starts[band + 1] = places[1].0[band] + counts[1].0[band];
    }
    let mut out = vec![T::default(); starts[bands] as usize];
    in_halves(items.len().min(spans.len()), |half, i| {
        if !is_tall(spans[i]) {
            places[half].add(spans[i], |place| out[place as usize] = items[i]);
        }
    });
    (out, starts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_band_lists_the_items_that_touch_it() {
        let spans = [[0, 0], [2, 4], [0, 19], [3, 3], [4, 5], [5, 15], [3, 3], [0, 3]];
        let ids: Vec<u32> = (100..108).collect();
        let pairs: Vec<u32> = spans.into_iter().map(pair).collect();
        let boxed = |&id: &u32| BoxedFace { id, columns: id + 100, ..BoxedFace::default() };
        let boxed: Vec<BoxedFace> = ids.iter().map(boxed).collect();
        let kept = |boxed| KeptFaces { ids: ids.clone(), spans: pairs.clone(), boxed };
        let (plain, lists) = (BandLists::new(kept(Vec::new()), 20), BandLists::new(kept(boxed), 20));
        for band in 0..20 {
            let is_here = |span: &[i32; 2]| (span[0]..=span[1]).contains(&band);
            let want: Vec<u32> = (100..).zip(spans).filter(|(_, span)| is_here(span)).map(|(id, _)| id).collect();
            for lists in [&plain, &lists] {
                let (listed, others) = lists.items_in(band as usize);
                let mut found = [listed, &others].concat();
                assert!(found.is_empty() || !lists.is_empty_in(band as usize), "band {band}");
                found.sort_unstable();
                assert_eq!(found, want, "band {band}");
            }
            let (listed, tall) = lists.boxed_in(band as usize);
            assert_eq!(listed.len() + tall.len(), want.len(), "band {band}");
            assert!(listed.iter().chain(&tall).all(|face| face.columns == face.id + 100), "band {band}");
        }
        // Items that touch few bands are not visited in the others.
        assert_eq!(lists.tall.len(), 2);
        assert_eq!(lists.all, (100..108).collect::<Vec<_>>());
        assert_eq!(BandLists::default().items_in(3), (&[][..], Vec::new()));
    }

    #[test]
    fn pairs_hold_numbers_on_both_sides_of_zero() {
        for numbers in [[0, 0], [-4097, 8193], [5, -3], [i32::from(i16::MIN), i32::from(i16::MAX)]] {
            assert_eq!(unpair(pair(numbers)), numbers);
        }
    }
}
