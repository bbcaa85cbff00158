//! One coordinate of a search: an integer or a granular real between bounds.

/// Position of every variable, counted in ticks of its granularity.
///
/// Counting in whole ticks keeps the arithmetic of the mesh exact, so a point
/// can be compared and hashed without tolerance.
pub type Point = Vec<i64>;

/// An integer or granular-real variable with bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name for reports.
    pub name: String,
    /// Smallest admissible tick, inclusive.
    pub lower: i64,
    /// Largest admissible tick, inclusive; not below `lower`.
    pub upper: i64,
    /// Size of one tick in the variable's own unit, positive: 1 for an integer.
    pub granularity: f64,
}

impl Variable {
    /// An integer between `lower` and `upper`, both included.
    pub fn integer(name: impl Into<String>, lower: i64, upper: i64) -> Self {
        Self {
            name: name.into(),
            lower,
            upper,
            granularity: 1.0,
        }
    }

    /// A real that takes the values `tick × granularity`, rounded inwards to
    /// the bounds given in the variable's unit.
    pub fn granular(name: impl Into<String>, lower: f64, upper: f64, granularity: f64) -> Self {
        Self {
            name: name.into(),
            lower: (lower / granularity - 1e-9).ceil() as i64,
            upper: (upper / granularity + 1e-9).floor() as i64,
            granularity,
        }
    }

    /// Value at a tick, in the variable's unit.
    pub fn value(&self, tick: i64) -> f64 {
        tick as f64 * self.granularity
    }

    /// Nearest admissible tick to a value in the variable's unit.
    pub fn tick(&self, value: f64) -> i64 {
        ((value / self.granularity).round() as i64).clamp(self.lower, self.upper)
    }

    /// Nearest admissible tick.
    pub fn clamp(&self, tick: i64) -> i64 {
        tick.clamp(self.lower, self.upper)
    }

    /// Number of steps between the bounds; 0 for a variable that cannot move.
    pub fn range(&self) -> i64 {
        self.upper - self.lower
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn granular_bounds_round_inwards_and_decimal_ends_stay() {
        let factor = Variable::granular("f", 0.0, 8.3, 1e-4);
        assert_eq!((factor.lower, factor.upper), (0, 83_000));
        assert_eq!(factor.value(10_000), 1.0);
        assert_eq!(factor.tick(99.0), 83_000);
        let odd = Variable::granular("x", 0.15, 0.95, 0.1);
        assert_eq!((odd.lower, odd.upper), (2, 9));
    }
}
