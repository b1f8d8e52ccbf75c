//! An element's properties, compiled: what of each record is kept, where it lies, and what is passed over. Names are looked
//! at here, once, and not again for any record.

use super::header::{Element, Kind, Property, Shape};

/// Numbers of one record that can be kept.
pub const VALUES_MAX: usize = 12;
/// Lists of one record that can be kept.
pub const LISTS_MAX: usize = 2;

/// Where a property goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// Into [`Row::values`].
    Value(usize),
    /// Into [`Row::lists`].
    List(usize),
}

/// One step through a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Passes over numbers.
    Skip {
        /// How many.
        numbers: usize,
        /// What they take in a binary body.
        bytes: usize,
    },
    /// Reads a number.
    Value {
        /// Its type.
        kind: Kind,
        /// Where it goes.
        slot: usize,
        /// Where it lies in the record, as long as no list came before.
        offset: usize,
    },
    /// Reads a list, or passes over it.
    List {
        /// Type of its count.
        count: Kind,
        /// Type of its items.
        item: Kind,
        /// Where it goes.
        slot: Option<usize>,
    },
}

/// The steps through a record of an element.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// In order.
    pub steps: Vec<Step>,
    /// Bytes of a binary record; None where lists make them differ.
    pub stride: Option<usize>,
    /// The type of each value that is kept.
    pub kinds: [Option<Kind>; VALUES_MAX],
    /// Which lists are kept.
    pub lists: [bool; LISTS_MAX],
}

/// A record, read.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// By slot. f64 holds every number of every type exactly.
    pub values: [f64; VALUES_MAX],
    /// By slot.
    pub lists: [Vec<f64>; LISTS_MAX],
}

impl Layout {
    /// Of an element; `slot` says what is wanted. Of two properties for one slot the first counts.
    pub fn new(element: &Element, slot: impl Fn(&str) -> Option<Slot>) -> Self {
        let mut layout = Self { stride: Some(0), ..Self::default() };
        for property in &element.properties {
            let slot = slot(&property.name);
            layout.push(property, slot);
        }
        layout
    }

    /// Whether all of some values are there.
    pub fn has(&self, slots: std::ops::Range<usize>) -> bool {
        self.kinds[slots].iter().all(Option::is_some)
    }

    fn push(&mut self, property: &Property, slot: Option<Slot>) {
        match (property.shape, slot) {
            (Shape::List { count, item }, slot) => {
                let slot = match slot {
                    Some(Slot::List(slot)) if !self.lists[slot] => Some(slot),
                    _ => None,
                };
                if let Some(slot) = slot {
                    self.lists[slot] = true;
                }
                self.stride = None;
                self.steps.push(Step::List { count, item, slot });
            }
            (Shape::One(kind), Some(Slot::Value(slot))) if self.kinds[slot].is_none() => {
                self.kinds[slot] = Some(kind);
                let offset = self.stride.unwrap_or(0);
                self.steps.push(Step::Value { kind, slot, offset });
                self.grow(kind.bytes());
            }
            (Shape::One(kind), _) => {
                if let Some(Step::Skip { numbers, bytes }) = self.steps.last_mut() {
                    *numbers += 1;
                    *bytes += kind.bytes();
                } else {
                    self.steps.push(Step::Skip { numbers: 1, bytes: kind.bytes() });
                }
                self.grow(kind.bytes());
            }
        }
    }

    fn grow(&mut self, bytes: usize) {
        self.stride = self.stride.map(|stride| stride + bytes);
    }
}
