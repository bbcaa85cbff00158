//! Independent pieces of work on all processors; the only user of rayon's iterators.
//!
//! They are compiled once, for a closure behind a reference; a copy for each closure would need 7 kB of code.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Number of threads that share the work.
pub(crate) fn threads() -> usize {
    rayon::current_num_threads()
}

/// A collection whose items can be given to different threads.
pub(crate) trait Items {
    type Item;

    /// Number of items.
    fn count(&self) -> usize;

    /// The items by their indices; each is requested once.
    fn by_place(self) -> impl Fn(usize) -> Self::Item + Sync;
}

impl Items for Range<usize> {
    type Item = usize;

    fn count(&self) -> usize {
        self.len()
    }

    fn by_place(self) -> impl Fn(usize) -> usize + Sync {
        move |place| self.start + place
    }
}

impl<'a, T: Sync> Items for &'a [T] {
    type Item = &'a T;

    fn count(&self) -> usize {
        self.len()
    }

    fn by_place(self) -> impl Fn(usize) -> &'a T + Sync {
        move |place| &self[place]
    }
}

impl<'a, T: Sync> Items for &'a Vec<T> {
    type Item = &'a T;

    fn count(&self) -> usize {
        self.len()
    }

    fn by_place(self) -> impl Fn(usize) -> &'a T + Sync {
        self.as_slice().by_place()
    }
}

impl<T: Send> Items for Vec<T> {
    type Item = T;

    fn count(&self) -> usize {
        self.len()
    }

    fn by_place(self) -> impl Fn(usize) -> T + Sync {
        let items: Vec<Option<T>> = self.into_iter().map(Some).collect();
        let items = Mutex::new(items);
        move |place| {
            held(&items)[place]
                .take()
                .expect("each item is requested once")
        }
    }
}

/// The results of `make` for each of `items`, in their order.
pub(crate) fn each<I: Items, T: Send>(items: I, make: impl Fn(I::Item) -> T + Sync) -> Vec<T> {
    let (count, item) = (items.count(), items.by_place());
    gathered(count, &|place| Some(make(item(place))))
}

/// The results of `make` for each of `items`, in their order, without the `None`s.
pub(crate) fn some<I: Items, T: Send>(
    items: I,
    make: impl Fn(I::Item) -> Option<T> + Sync,
) -> Vec<T> {
    let (count, item) = (items.count(), items.by_place());
    gathered(count, &|place| make(item(place)))
}

/// The results of `make` for each of `items`, in their order; after the first `None` no further items are started.
pub(crate) fn all<I: Items, T: Send>(
    items: I,
    make: impl Fn(I::Item) -> Option<T> + Sync,
) -> Option<Vec<T>> {
    let (count, item) = (items.count(), items.by_place());
    let in_vain = AtomicBool::new(false);
    let made = gathered(count, &|place| {
        if in_vain.load(Ordering::Relaxed) {
            return None;
        }
        let made = make(item(place));
        if made.is_none() {
            in_vain.store(true, Ordering::Relaxed);
        }
        made
    });
    (made.len() == count).then_some(made)
}

fn gathered<T: Send>(count: usize, make: &(dyn Fn(usize) -> Option<T> + Sync)) -> Vec<T> {
    if count <= 1 {
        return (0..count).filter_map(make).collect();
    }
    let mut places = Vec::new();
    places.resize_with(count, || None);
    let places = Mutex::new(places);
    at_once(count, &|place| {
        let made = make(place);
        held(&places)[place] = made;
    });
    let places = places.into_inner().unwrap_or_else(PoisonError::into_inner);
    places.into_iter().flatten().collect()
}

/// Locks are held only while a value is moved, so they are never poisoned.
fn held<T>(items: &Mutex<T>) -> MutexGuard<'_, T> {
    items.lock().unwrap_or_else(PoisonError::into_inner)
}

fn at_once(count: usize, work: &(dyn Fn(usize) + Sync)) {
    // The pieces of work take long and differ in length, so a free thread takes one at a time.
    let places = (0..count).into_par_iter().with_max_len(1);
    places.for_each(work);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        let words: Vec<String> = (0..100).map(|i| i.to_string()).collect();
        assert_eq!(each(&words, String::clone), words);
        assert_eq!(each(words.clone(), |word| word), words);
        assert_eq!(each(&words[..1], String::clone), words[..1]);
        assert!(each(5..5, |i| i).is_empty());
        let odd = some(3..10, |i| (i % 2 == 1).then_some(i));
        assert_eq!(odd, [3, 5, 7, 9]);
    }

    #[test]
    fn all_or_none_and_none_are_begun_in_vain() {
        assert_eq!(all(2..5, Some), Some(vec![2, 3, 4]));
        assert_eq!(all(0..0, Some), Some(vec![]));
        let begun = AtomicUsize::new(0);
        let first_fails = |_| {
            begun.fetch_add(1, Ordering::Relaxed);
            None::<usize>
        };
        assert_eq!(all(0..1_000_000, first_fails), None);
        assert!(begun.into_inner() <= rayon::current_num_threads());
    }
}
