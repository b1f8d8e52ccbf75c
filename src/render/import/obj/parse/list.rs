//! Lists (of positions, normals, corners ...) that a part of an OBJ text fills while it is parsed.
//! For each list one block of memory is reserved for the whole text, by an estimate, and each part
//! fills its own place in it.
//!
//! Items that find no room go to a list beside the block. If each place is filled exactly, the
//! block is the finished list and nothing is copied. Otherwise all items are copied into a new one.

use crate::parallel::concat_slices;

/// A list of a part while it grows: first in its place of the room, then beside it.
#[derive(Debug)]
pub struct List<'r, T> {
    place: &'r mut [T],
    filled: Filled<T>,
}

/// A list of a part. A room without surprises has all of it.
#[derive(Debug, Default)]
pub struct Filled<T> {
    /// Items in the part's place of the room.
    in_place: usize,
    /// The items that found no room.
    more: Vec<T>,
}

impl<'r, T: Copy> List<'r, T> {
    /// An empty list that begins in `place`.
    pub fn new(place: &'r mut [T]) -> Self {
        Self { place, filled: Filled { in_place: 0, more: Vec::new() } }
    }

    /// Number of items.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.filled.len()
    }

    /// Adds an item.
    #[inline(always)]
    pub fn push(&mut self, item: T) {
        self.extend(&[item]);
    }

    /// Adds some items.
    #[inline(always)]
    pub fn extend(&mut self, items: &[T]) {
        let at = self.filled.in_place;
        match self.place.get_mut(at..at + items.len()) {
            // Once some found no room, none after them may have any.
            Some(place) if self.filled.more.is_empty() => {
                place.copy_from_slice(items);
                self.filled.in_place += items.len();
            }
            _ => self.extend_beside(items),
        }
    }

    #[cold]
    fn extend_beside(&mut self, items: &[T]) {
        self.filled.more.extend_from_slice(items);
    }

    /// Gives back its place.
    pub fn finish(self) -> Filled<T> {
        self.filled
    }
}

impl<T> Filled<T> {
    /// Number of items.
    pub fn len(&self) -> usize {
        self.in_place + self.more.len()
    }
}

/// One list of those of all parts; the length of each one's place in `room` comes with it. It is the
/// room itself if all places are full and nothing lies beside them.
pub fn join<T: Copy + Default + Send + Sync>(room: Vec<T>, lists: impl Iterator<Item = (usize, Filled<T>)>) -> Vec<T> {
    let lists: Vec<(usize, Filled<T>)> = lists.collect();
    if lists.iter().all(|(place, list)| list.in_place == *place && list.more.is_empty()) {
        return room;
    }
    let mut slices = Vec::with_capacity(2 * lists.len());
    let mut at = 0;
    for (place, list) in &lists {
        slices.extend([&room[at..at + list.in_place], &list.more]);
        at += place;
    }
    concat_slices(&slices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_join_whatever_room_they_had() {
        for rooms in [[3, 3], [0, 0], [2, 9], [9, 2], [3, 0]] {
            let mut room = vec![0; rooms[0] + rooms[1]];
            let (first, second) = room.split_at_mut(rooms[0]);
            let (mut first, mut second) = (List::new(first), List::new(second));
            first.push(1);
            first.extend(&[2, 3]);
            second.extend(&[4, 5]);
            second.push(6);
            assert_eq!([first.len(), second.len()], [3, 3]);
            let lists = [first.finish(), second.finish()];
            assert_eq!(join(room, rooms.into_iter().zip(lists)), [1, 2, 3, 4, 5, 6], "{rooms:?}");
        }
    }
}
