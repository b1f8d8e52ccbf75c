//! Arrays that a plan either borrows from its mesh or owns. An owned array may serve several fields of
//! the plan without being copied.

use std::ops::Deref;
use std::sync::Arc;

/// An array that is borrowed from the mesh, or owned by several fields of a plan together.
///
/// Unlike a `Cow`, an owned array is not copied when it is cloned: a triangle index may serve
/// normals, texture coordinates and colours at once.
#[derive(Clone, Debug)]
pub enum SharedSlice<'a, T> {
    /// Borrowed from the mesh.
    Borrowed(&'a [T]),
    /// Made for this plan.
    Owned(Arc<Vec<T>>),
}

impl<T> Deref for SharedSlice<'_, T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match self {
            Self::Borrowed(slice) => slice,
            Self::Owned(list) => list,
        }
    }
}

impl<T> Default for SharedSlice<'_, T> {
    fn default() -> Self {
        Self::Borrowed(&[])
    }
}

impl<'a, T> From<&'a [T]> for SharedSlice<'a, T> {
    fn from(slice: &'a [T]) -> Self {
        Self::Borrowed(slice)
    }
}

impl<'a, T, const N: usize> From<&'a [T; N]> for SharedSlice<'a, T> {
    fn from(array: &'a [T; N]) -> Self {
        Self::Borrowed(array)
    }
}

impl<'a, T> From<&'a Vec<T>> for SharedSlice<'a, T> {
    fn from(list: &'a Vec<T>) -> Self {
        Self::Borrowed(list)
    }
}

impl<T> From<Vec<T>> for SharedSlice<'_, T> {
    fn from(list: Vec<T>) -> Self {
        Self::Owned(Arc::new(list))
    }
}
