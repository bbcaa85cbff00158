//! Lag of the hot film and its substrate.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// τ·ẏ = s − y, exact for a friction that is linear between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HotFilmLag<T> {
    kept: T,
    from_before: T,
    from_now: T,
}

/// Output and last input of the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film<T> {
    shown: T,
    signal: T,
}

impl<T: Real> Effect<T> for HotFilmLag<T> {
    type State = Film<T>;
    fn start(&self) -> Film<T> {
        Film {
            shown: T::ZERO,
            signal: T::ZERO,
        }
    }
    #[inline(always)]
    fn sense(&self, film: &mut Film<T>, signal: T, _at: &Instant<'_, T>) -> T {
        film.shown =
            self.kept * film.shown + self.from_before * film.signal + self.from_now * signal;
        film.signal = signal;
        film.shown
    }
}

impl<T: Real> Physics<T> for HotFilmLag<T> {
    const SPEC: Spec = Spec {
        name: "hot-film-lag",
        rust: "hot_film_lag::HotFilmLag",
        place: Place::Sensor,
        summary: "the hot film follows the friction with a first-order lag",
        equation: "τ·ẏ = s − y",
        parameters: &[Parameter::new(
            "time_constant",
            Unit::Second,
            [0.002, 2.0],
            &[0.006, 0.03, 0.2],
        )],
        amplitude: Some(Amplitude::new("time_constant", "a lag of the hot film")),
        lag_in_series: true,
        source: "Bruun, Hot-wire Anemometry (1995)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [time] = take(parameters);
        let kept = (-setting.period / time).exp();
        let mean = (T::ONE - kept) * time / setting.period;
        Self {
            kept,
            from_before: mean - kept,
            from_now: T::ONE - mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{prepared, readings};

    #[test]
    fn it_trails_a_ramp_by_its_time_and_ends_where_the_signal_does() {
        let film: HotFilmLag<f64> = prepared(&[0.050]);
        let y = readings(&film, |k| k as f64 * 0.001, |_| 0.0);
        // The exact response to a ramp is t − τ·(1 − exp(−t/τ)).
        for k in [10_usize, 50, 999] {
            let t = k as f64 * 0.001;
            let expected = t - 0.05 * (1.0 - (-t / 0.05).exp());
            assert!((y[k] - expected).abs() < 1e-12, "{k}");
        }
        assert!((readings(&film, |_| 0.7, |_| 0.0)[999] - 0.7).abs() < 1e-6);
    }
}
