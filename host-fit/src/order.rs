//! Items sorted by a number of each. Only their indices are sorted, so that one compiled sort serves items of all
//! types; a sort for another type would need 6 kB of code.

/// Sorts in ascending order of the numbers (`f64::total_cmp`); equal ones keep their order.
pub(crate) fn ascending<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    let mut to = places(&items.iter().map(number).collect::<Vec<_>>());
    for at in 0..to.len() {
        while to[at] != at {
            let place = to[at];
            items.swap(at, place);
            to.swap(at, place);
        }
    }
}

/// Sorts in descending order of the numbers (`f64::total_cmp`); equal ones keep their order.
pub(crate) fn descending<T>(items: &mut [T], number: impl Fn(&T) -> f64) {
    ascending(items, |item| -number(item));
}

/// The indices of `numbers` in ascending order.
fn places(numbers: &[f64]) -> Vec<usize> {
    let mut sorted: Vec<usize> = (0..numbers.len()).collect();
    sorted.sort_by(|a, b| numbers[*a].total_cmp(&numbers[*b]));
    let mut places = vec![0; sorted.len()];
    for (place, from) in sorted.into_iter().enumerate() {
        places[from] = place;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_a_stable_sort() {
        let mut state = 1_u32;
        let number = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            [-0.0, 0.0, f64::NAN, -f64::NAN, 1.0, -2.0, f64::INFINITY][(state >> 8) as usize % 7]
        };
        let given: Vec<(f64, usize)> = (0..200).map(number).zip(0..).collect();
        let places = |all: &[(f64, usize)]| all.iter().map(|a| a.1).collect::<Vec<_>>();
        let (mut up, mut down) = (given.clone(), given.clone());
        ascending(&mut up, |item| item.0);
        descending(&mut down, |item| item.0);
        let mut sorted = given;
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(places(&up), places(&sorted));
        sorted.sort_by_key(|item| item.1);
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        assert_eq!(places(&down), places(&sorted));
    }
}
