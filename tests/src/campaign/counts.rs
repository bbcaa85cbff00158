//! Counts and times as cells of a table.

use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The rows by a property.
pub(super) fn grouped<'a, R>(
    rows: &[&'a R],
    of: impl Fn(&'a R) -> &'a str,
) -> BTreeMap<&'a str, Vec<&'a R>> {
    let mut groups: BTreeMap<&str, Vec<&R>> = BTreeMap::new();
    for row in rows {
        groups.entry(of(row)).or_default().push(row);
    }
    groups
}

/// The rows that pass a test.
pub(super) fn those<'a, R>(rows: &[&'a R], test: impl Fn(&R) -> bool) -> Vec<&'a R> {
    rows.iter().copied().filter(|row| test(row)).collect()
}

/// A list item with the share of the rows that pass a test; nothing without rows.
pub(super) fn item<R>(text: &mut String, what: &str, rows: &[&R], test: &dyn Fn(&R) -> bool) {
    if !rows.is_empty() {
        let hits = rows.iter().filter(|row| test(row)).count();
        let _ = writeln!(text, "- {what}: {}", bounded(hits, rows.len()));
    }
}

/// Number of rows that pass a test, of all rows: "3/4".
pub(super) fn share<'a, R>(rows: &[&'a R], test: impl Fn(&'a R) -> bool) -> String {
    let hits = rows.iter().filter(|row| test(row)).count();
    format!("{hits}/{}", rows.len())
}

/// Median and longest (s).
pub(super) fn seconds<R>(rows: &[&R], of: impl Fn(&R) -> Option<f64>) -> String {
    let mut all: Vec<f64> = rows.iter().filter_map(|row| of(row)).collect();
    all.sort_by(f64::total_cmp);
    let (Some(median), Some(longest)) = (all.get(all.len() / 2), all.last()) else {
        return "-".to_owned();
    };
    format!("{median:.0} / {longest:.0}")
}

/// "95 of 100 (95 %, 89–98 %)": the share and Wilson's bounds with 95 % confidence.
pub(crate) fn bounded(hits: usize, all: usize) -> String {
    const Z: f64 = 1.959_964;
    let (k, n) = (hits as f64, all as f64);
    let share = k / n;
    let middle = (k + Z * Z / 2.0) / (n + Z * Z);
    let half = Z * n.sqrt() / (n + Z * Z) * (share * (1.0 - share) + Z * Z / (4.0 * n)).sqrt();
    let low = (middle - half).max(0.0);
    let [share, low, high] = [share, low, middle + half].map(|x| 100.0 * x);
    format!("{hits} of {all} ({share:.1} %, {low:.1}–{high:.1} %)")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand; 0 of n has the upper bound z²/(n + z²).
    #[test]
    fn shares_have_wilsons_bounds() {
        assert_eq!(bounded(95, 100), "95 of 100 (95.0 %, 88.8–97.8 %)");
        assert_eq!(bounded(0, 100), "0 of 100 (0.0 %, 0.0–3.7 %)");
        assert_eq!(bounded(0, 71), "0 of 71 (0.0 %, 0.0–5.1 %)");
    }
}
