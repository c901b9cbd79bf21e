//! Heap sort: no recursion and no buffer, so that its stack is that of one call.
//!
//! The core library's sorts need a buffer or recurse, up to 15 KiB for the longest list of a search.

/// Sorts a list, the smallest element first: at most 2·n·log₂ n comparisons. Equal elements come in any order.
pub(super) fn sort_by<T: Copy>(list: &mut [T], less: impl Fn(&T, &T) -> bool) {
    for root in (0..list.len() / 2).rev() {
        sift_down(list, root, &less);
    }
    for end in (1..list.len()).rev() {
        exchange(list, 0, end);
        sift_down(list.get_mut(..end).unwrap_or_default(), 0, &less);
    }
}

/// Makes a heap of the elements below `root`, of whose two branches each is one.
fn sift_down<T: Copy>(heap: &mut [T], mut root: usize, less: &impl Fn(&T, &T) -> bool) {
    loop {
        let left = root.saturating_mul(2).saturating_add(1);
        let right = left.saturating_add(1);
        let (Some(parent), Some(first)) = (heap.get(root), heap.get(left)) else { return };
        let (largest, child) = match heap.get(right) {
            Some(second) if less(first, second) => (right, second),
            _ => (left, first),
        };
        if !less(parent, child) {
            return;
        }
        exchange(heap, root, largest);
        root = largest;
    }
}

/// Exchanges two elements that exist.
fn exchange<T: Copy>(list: &mut [T], a: usize, b: usize) {
    if let Ok([a, b]) = list.get_disjoint_mut([a, b]) {
        core::mem::swap(a, b);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::sort_by;
    use crate::arms::seeded;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(seeded(256))]

        #[test]
        fn lists_are_sorted_as_the_core_library_does(list in prop::collection::vec(-50i16..50, 0..300)) {
            let (mut sorted, mut expected) = (list.clone(), list);
            sort_by(&mut sorted, |a, b| a < b);
            expected.sort_unstable();
            prop_assert_eq!(sorted, expected);
        }
    }
}
