//! Quadratic resistance against fast changes.

use crate::plant::SAMPLE_PERIOD_S;
use crate::plant::effects::physics;
use crate::plant::part::{FlowPart, Part, Resistance};

physics! {
    /// −d·Δs·|Δs| with Δs the change per sample.
    QuadraticDrag = "quadratic-drag" at Flow
    parameters(base, rng) {
        /// d.
        // The value is the resistance against the fastest motion, relative to the flow's own.
        coefficient ["samples/y", NOT_NEGATIVE] =
            rng.random_range(0.5..1.5) * fast / SAMPLE_PERIOD_S;
    }
    where { let fast = base.attach_s.min(base.separate_s); }
    part(law, _) { Part::Flow(Box::new(*law)) }
}

impl FlowPart for QuadraticDrag {
    fn resistance(&self) -> Resistance {
        Resistance {
            dry: 0.0,
            drag: self.coefficient * SAMPLE_PERIOD_S,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::flow::bench::{flow, hold};

    #[test]
    fn quadratic_drag_slows_fast_changes_by_its_closed_form() {
        // Change per sample over the first or the next 50 µs.
        let speed = |flow: &mut _, jet| {
            let before = hold(flow, jet, 0.0);
            20.0 * (hold(flow, jet, 5e-5) - before)
        };
        let mut flow = flow([QuadraticDrag { coefficient: 30.0 }.at_rest()]);
        // In the first sample of a step, v + d·v² = 1/40 per sample.
        let rising: f64 = speed(&mut flow, 1.0);
        assert!((rising + 30.0 * rising * rising - 0.025).abs() < 2e-5);
        hold(&mut flow, 1.0, 5.0);
        let falling = speed(&mut flow, 0.0);
        assert!((falling - 30.0 * falling * falling + 0.01).abs() < 1e-5);
    }
}
