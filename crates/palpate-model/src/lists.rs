//! Lists of lists in two arrays.

/// Lists of items, one after the other in one array: neighbours of nodes, parts of elements.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lists<T> {
    starts: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy + Default> Lists<T> {
    /// Sorts entries (list, item) into `count` lists, where they keep their order. O(lists + entries).
    ///
    /// # Panics
    /// If an entry's list is not below `count`.
    pub fn new(count: usize, entries: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut starts = vec![0_u32; count + 1];
        for (list, _) in entries.clone() {
            starts[list as usize + 1] += 1;
        }
        for list in 0..count {
            starts[list + 1] += starts[list];
        }
        let mut next = starts.clone();
        let mut items = vec![T::default(); starts[count] as usize];
        for (list, item) in entries {
            let place = &mut next[list as usize];
            items[*place as usize] = item;
            *place += 1;
        }
        Self { starts, items }
    }
}

impl<T> Lists<T> {
    /// The items of a list.
    ///
    /// # Panics
    /// If there is no such list.
    #[inline]
    pub fn of(&self, list: u32) -> &[T] {
        let list = list as usize;
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }

    /// All lists, in their order.
    pub fn iter(&self) -> impl Iterator<Item = &[T]> {
        self.starts.windows(2).map(|range| &self.items[range[0] as usize..range[1] as usize])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn items_stand_in_their_lists_in_the_order_in_which_they_came(
            count in 1_u32..20,
            lists in proptest::collection::vec(any::<u32>(), 0..60),
        ) {
            let entries: Vec<(u32, usize)> = lists.iter().map(|list| list % count).zip(0..).collect();
            let made = Lists::new(count as usize, entries.iter().copied());
            for list in 0..count {
                let expected: Vec<usize> =
                    entries.iter().filter(|entry| entry.0 == list).map(|entry| entry.1).collect();
                prop_assert_eq!(made.of(list), expected);
            }
            prop_assert_eq!(made.iter().count(), count as usize);
            prop_assert!(made.iter().flatten().count() == entries.len());
        }
    }
}
