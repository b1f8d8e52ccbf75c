//! The walk through the records of a PLY body, in any encoding. The counts of lists are checked
//! against what is left of the file, the deadline is polled, and memory is counted against the
//! job's limit.

use super::header::{Element, Kind};
use super::layout::{Layout, Row, Step, VALUES_MAX};
use crate::import::MeshError;
use crate::import::context::Context;

/// Records, or items of one list, between two deadline checks.
const RECORDS_PER_POLL: u64 = 65_536;
/// Bytes per payment.
const PAY_BYTES: u64 = 1 << 20;

/// Values of some records, one column per slot.
pub type Columns = [Vec<f64>; VALUES_MAX];

/// The numbers of a body, in order. A method that returns None keeps the position, so that
/// [`Source::why`] can explain it.
pub trait Source {
    /// The next number.
    fn value(&mut self, kind: Kind) -> Option<f64>;
    /// Appends the next `count` numbers to `items`.
    fn values(&mut self, kind: Kind, count: usize, items: &mut Vec<f64>) -> Option<()>;
    /// Skips some numbers, which take `bytes` in a binary body.
    fn skip(&mut self, numbers: usize, bytes: usize) -> Option<()>;
    /// The next `bytes`, which are records of a fixed size.
    fn block(&mut self, bytes: usize) -> Option<&[u8]>;
    /// Replaces `columns` with the values of such records, of `stride` bytes each.
    fn columns(layout: &Layout, stride: usize, records: &[u8], columns: &mut Columns);
    /// Number of the next records, at most `records`, that are lists of three indices and nothing
    /// else. 0 where [`Source::triangles`] would be no faster than record by record.
    fn triangles_max(&self, _layout: &Layout, _records: u64) -> u64 {
        0
    }
    /// Reads up to `records` such triangles, as long as indices are below `vertices`. Appends the
    /// indices.
    fn triangles(&mut self, _records: u64, _vertices: u32, _corners: &mut Vec<u32>) {}
    /// True if [`Source::block`] and [`Source::columns`] work.
    fn is_in_columns(&self) -> bool;
    /// An upper bound for the numbers left.
    fn numbers_left(&self, kind: Kind) -> u64;
    /// Bytes read so far.
    fn at(&self) -> usize;
    /// A position in words.
    fn place(&self, at: usize) -> String;
    /// The reason why there was no next number, as the beginning of a sentence that ends with the
    /// record's name.
    fn why(&self) -> String;
    /// Meaningful bytes after the current position.
    fn trailing_bytes(&self) -> usize;
}

/// Counts what has been read and not yet paid for.
#[derive(Debug, Default)]
pub struct Meter {
    unpaid_bytes: u64,
    /// Triangles so far, at least.
    triangles: u64,
}

/// Memory of an element's records once read, in bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Each.
    pub record: u64,
    /// Per item of its lists.
    pub item: u64,
}

/// Reads all records of an element. `keep` gets each, and returns its number of triangles or a
/// fault.
pub fn each_record<S: Source>(
    source: &mut S,
    element: &Element,
    layout: &Layout,
    paying: (Cost, &mut Meter),
    cx: &mut Context<'_>,
    keep: impl FnMut(&Row) -> Result<u64, String>,
) -> Result<(), MeshError> {
    each_record_from(0, source, element, layout, paying, cx, keep)
}

/// The triangles at the begin of an element that is nothing but triangles for a while. Returns how
/// many were read.
pub fn leading_triangles<S: Source>(
    source: &mut S,
    element: &Element,
    layout: &Layout,
    vertices: u32,
    (cost, meter): (Cost, &mut Meter),
    corners: &mut Vec<u32>,
    cx: &mut Context<'_>,
) -> Result<u64, MeshError> {
    cx.deadline.check()?;
    let most = source.triangles_max(layout, element.count);
    cx.budget.spend("the PLY file", most, cost.record + 3 * cost.item)?;
    let before = corners.len();
    source.triangles(most, vertices, corners);
    let read = (corners.len() - before) as u64 / 3;
    meter.triangles += read;
    meter.pay(cx)?;
    Ok(read)
}

/// As [`each_record`], from the record numbered `first`.
pub fn each_record_from<S: Source>(
    first: u64,
    source: &mut S,
    element: &Element,
    layout: &Layout,
    (cost, meter): (Cost, &mut Meter),
    cx: &mut Context<'_>,
    mut keep: impl FnMut(&Row) -> Result<u64, String>,
) -> Result<(), MeshError> {
    if layout.steps.is_empty() {
        return Ok(()); // however many there are
    }
    let mut row = Row::default();
    for number in first..element.count {
        if number % RECORDS_PER_POLL == 0 {
            cx.deadline.check()?;
        }
        let begin = source.at();
        read_record(source, layout, &mut row, cx).map_err(|fault| match fault {
            RecordError::NoValue => {
                let (place, why) = (source.place(source.at()), source.why());
                MeshError::broken(format!("{place}: {why} {}", name(element, number)))
            }
            RecordError::Says(what) => {
                let place = source.place(begin);
                MeshError::broken(format!("{place}: {} {what}", name(element, number)))
            }
            RecordError::Is(error) => *error,
        })?;
        // Paid before anything is kept, because one list may be the whole file.
        let items = row.lists.iter().map(|list| list.len() as u64).sum::<u64>();
        meter.unpaid_bytes += cost.record + cost.item * items;
        if meter.unpaid_bytes > PAY_BYTES {
            meter.pay(cx)?;
        }
        meter.triangles += keep(&row).map_err(|what| {
            let place = source.place(begin);
            MeshError::broken(format!("{place}: {} {what}", name(element, number)))
        })?;
    }
    meter.pay(cx)
}

/// Skips an element.
pub fn pass_over<S: Source>(
    source: &mut S,
    element: &Element,
    meter: &mut Meter,
    cx: &mut Context<'_>,
) -> Result<(), MeshError> {
    let layout = Layout::new(element, |_| None);
    // A binary element without lists is one step.
    if let (Some(stride), true) = (layout.stride, source.is_in_columns()) {
        let bytes = element.count.checked_mul(stride as u64).and_then(|bytes| usize::try_from(bytes).ok());
        return bytes.and_then(|bytes| source.skip(0, bytes)).ok_or_else(|| ends_within(source, element, stride, 0));
    }
    each_record(source, element, &layout, (Cost::default(), meter), cx, |_| Ok(0))
}

/// The error for a file that ends within records of a fixed size. `next` is the index of the next
/// record.
pub fn ends_within<S: Source>(source: &S, element: &Element, stride: usize, next: u64) -> MeshError {
    let whole = source.trailing_bytes() / stride.max(1);
    let place = source.place(source.at() + whole * stride);
    MeshError::broken(format!("{place}: the file ends within {}", name(element, next + whole as u64)))
}

/// `vertex 3 of 8`, counted from 1.
fn name(element: &Element, number: u64) -> String {
    format!("{} {} of {}", super::header::word(element.name.as_bytes()), number + 1, element.count)
}

/// Errors of reading a record. Small, because it goes through hot loops.
enum RecordError {
    /// No next number; the source knows why.
    NoValue,
    /// A fault, as the sentence after the record's name.
    Says(Box<str>),
    /// Any other error.
    Is(Box<MeshError>),
}

fn read_record<S: Source>(
    source: &mut S,
    layout: &Layout,
    row: &mut Row,
    cx: &mut Context<'_>,
) -> Result<(), RecordError> {
    for step in &layout.steps {
        match *step {
            Step::Skip { numbers, bytes } => source.skip(numbers, bytes).ok_or(RecordError::NoValue)?,
            Step::Value { kind, slot, .. } => row.values[slot] = source.value(kind).ok_or(RecordError::NoValue)?,
            Step::List { count, item, slot } => {
                let given = source.value(count).ok_or(RecordError::NoValue)?;
                let count = list_length(source, given, item)?;
                match slot {
                    Some(slot) => read_list(source, item, count, &mut row.lists[slot], cx)?,
                    None => skip_list(source, item, count, cx)?,
                }
            }
        }
    }
    Ok(())
}

/// A count of items, checked against the rest of the file.
fn list_length<S: Source>(source: &S, given: f64, item: Kind) -> Result<usize, RecordError> {
    let count = given as u32;
    if f64::from(count) != given {
        return Err(RecordError::Says(format!("has a list of {given} items").into()));
    }
    if u64::from(count) > source.numbers_left(item) {
        let left = source.trailing_bytes();
        return Err(RecordError::Says(format!("has a list of {count} items, and only {left} bytes follow").into()));
    }
    Ok(count as usize)
}

fn read_list<S: Source>(
    source: &mut S,
    item: Kind,
    count: usize,
    list: &mut Vec<f64>,
    cx: &mut Context<'_>,
) -> Result<(), RecordError> {
    list.clear();
    if count > list.capacity() {
        let more = (count - list.capacity()) as u64;
        cx.budget.spend("a list of the PLY file", more, 8).map_err(boxed)?;
        list.reserve_exact(count);
    }
    in_pieces(count, cx, |piece| source.values(item, piece, list))
}

fn skip_list<S: Source>(source: &mut S, item: Kind, count: usize, cx: &Context<'_>) -> Result<(), RecordError> {
    in_pieces(count, cx, |piece| source.skip(piece, piece * item.bytes()))
}

/// Calls `read` in pieces, with a deadline check between them.
fn in_pieces(count: usize, cx: &Context<'_>, mut read: impl FnMut(usize) -> Option<()>) -> Result<(), RecordError> {
    let mut left = count;
    loop {
        let piece = left.min(RECORDS_PER_POLL as usize);
        read(piece).ok_or(RecordError::NoValue)?;
        left -= piece;
        if left == 0 {
            return Ok(());
        }
        cx.deadline.check().map_err(boxed)?;
    }
}

fn boxed(error: impl Into<MeshError>) -> RecordError {
    RecordError::Is(Box::new(error.into()))
}

impl Meter {
    fn pay(&mut self, cx: &mut Context<'_>) -> Result<(), MeshError> {
        cx.check_triangles(self.triangles)?;
        cx.budget.spend("the PLY file", self.unpaid_bytes, 1)?;
        self.unpaid_bytes = 0;
        Ok(())
    }
}
