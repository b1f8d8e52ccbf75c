//! The layout of a PLY element: its properties, translated into the steps that read one record
//! (keep a number, keep a list, skip). Names of properties are compared here once, not per record.

use super::header::{Element, Kind, Property, Shape};

/// Most numbers kept per record.
pub const VALUES_MAX: usize = 12;
/// Most lists kept per record.
pub const LISTS_MAX: usize = 2;

/// The destination of a property.
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
        /// Their number.
        numbers: usize,
        /// Their size in a binary body.
        bytes: usize,
    },
    /// Reads a number.
    Value {
        /// Its type.
        kind: Kind,
        /// Its slot.
        slot: usize,
        /// Its offset in the record, valid if no list came before.
        offset: usize,
    },
    /// Reads a list, or passes over it.
    List {
        /// Type of its count.
        count: Kind,
        /// Type of its items.
        item: Kind,
        /// Its slot.
        slot: Option<usize>,
    },
}

/// The steps through a record of an element.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// In order.
    pub steps: Vec<Step>,
    /// Bytes of a binary record. None if lists make it variable.
    pub stride: Option<usize>,
    /// The type of each value that is kept.
    pub kinds: [Option<Kind>; VALUES_MAX],
    /// True for lists that are kept.
    pub lists: [bool; LISTS_MAX],
}

/// The kept values of one record.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// By slot. f64 holds every number of every type exactly.
    pub values: [f64; VALUES_MAX],
    /// By slot.
    pub lists: [Vec<f64>; LISTS_MAX],
}

impl Layout {
    /// Compiles an element. `slot` names the destinations of wanted properties. Of two properties
    /// for one slot the first counts.
    pub fn new(element: &Element, slot: impl Fn(&str) -> Option<Slot>) -> Self {
        let mut layout = Self { stride: Some(0), ..Self::default() };
        for property in &element.properties {
            let slot = slot(&property.name);
            layout.push(property, slot);
        }
        layout
    }

    /// True if the element has all of some values.
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
