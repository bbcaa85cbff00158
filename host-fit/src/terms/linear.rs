//! First order, second order and ARX(2,2) as models of this crate, and the second order from which a search starts.

use super::hypothesis::Hypothesis;
use super::judge::{Judge, size};
use super::term::Term;
use crate::baseline::{Arx, Baselines, Recursion};
use crate::data::Record;
use crate::fit::Fit;
use crate::model::{Delay, Model, Start};
use model_core::effects::ConstantDelay;

/// First order, second order and ARX(2,2) on `records`, as linear models that start from measurements; those that
/// exist, in the units of the records.
pub(crate) fn baselines(frame: &Model, records: &[&Record]) -> Vec<Model> {
    let found = Baselines::fit(records);
    let period = frame.sample_period_s;
    let first = found.fopdt.map(|first| first.recursion(period));
    let second = found.sopdt.map(|second| second.recursion(period));
    let [first, second] = [first, second].map(|found| Some(recursion(frame, found?)));
    let arx = found.arx.map(|found| arx(frame, &found));
    let all = [first, second, arx].into_iter().flatten();
    all.filter(|model| model.values().iter().all(|v| v.is_finite()))
        .collect()
}

/// A linear model with these coefficients; its input delays are `delay`, `delay` + 1, … samples.
fn linear(frame: &Model, a: Vec<f64>, b: Vec<f64>, constant: f64, delay: f64) -> Model {
    let lags: Vec<u16> = (1..=a.len() as u16).collect();
    let whole = delay.max(0.0);
    // Several inputs have fixed delays. A law would need factors relative to the first delay, which may be 0.
    let delays: Vec<u16> = (0..b.len() as u16)
        .map(|later| (whole.round().clamp(0.0, 60_000.0) as u16) + later)
        .collect();
    Model {
        start: Start::Measured,
        constant,
        state_lags: lags,
        a,
        product_lags: vec![1],
        c: vec![0.0; b.len()],
        delay: if b.len() == 1 {
            Delay::of::<ConstantDelay<f64>>(&[whole], vec![1.0], true)
        } else {
            Delay::Fixed { delays }
        },
        b,
        effects: Vec::new(),
        ..frame.clone()
    }
}

/// The better one of first and second order, with one delay and without products. It is the model for records whose
/// command changes too seldom to identify how any parameter depends on y. Both are fitted and compared on all samples,
/// because validation samples would contain no change of the command.
pub(super) fn alone(judge: &Judge, frame: &Model) -> Option<Model> {
    let found = Baselines::fit(&judge.everything());
    let period = frame.sample_period_s;
    let first = found.fopdt.map(|first| first.recursion(period));
    let second = found.sopdt.map(|second| second.recursion(period));
    let all = [first, second].into_iter().flatten();
    let fitted = all.filter_map(|found| {
        let linear = Model {
            product_lags: Vec::new(),
            c: Vec::new(),
            ..one_input(frame, found)
        };
        judge.fitted_to_all(&linear).ok()
    });
    let size = |fit: &Fit| size(fit.mean_square().sqrt(), &fit.model);
    let best = fitted.min_by(|a, b| size(a).total_cmp(&size(b)));
    best.map(|fit| fit.model)
}

/// A second order with the delay law and the products of `root`, which is of first order. A search that adds one
/// term at a time finds it late, because the delay of the first-order model contains the second lag.
pub(crate) fn second_order(
    judge: &Judge,
    root: &Hypothesis,
    may_be_constant: bool,
) -> Option<Hypothesis> {
    let first = root.judged.model();
    let period = first.sample_period_s;
    let found = Baselines::second_order(&judge.learning(0))?;
    let linear = one_input(first, found.recursion(period));
    // The candidates are two lags in series, with the products of the first order, and the linear second
    // order, which may be underdamped.
    let in_series = found.time_constants_s.map(|[_, lag]| {
        let lag = lag / period;
        let mut model = first.clone();
        let later = linear.delay.present(0.0, period) + lag - model.delay.present(0.0, period);
        model.delay_later(later);
        Term::Inertia(lag).added_to(&model, &[])
    });
    let underdamped = Model {
        start: first.start,
        constant: first.constant,
        product_lags: vec![1, 2],
        c: vec![0.0; 2],
        effects: first.effects.clone(),
        ..linear
    };
    let all = in_series
        .into_iter()
        .chain(may_be_constant.then_some(underdamped));
    let judged = all.filter_map(|model| judge.refitted(&model).ok());
    let judged = judged.min_by(|a, b| a.rmse().total_cmp(&b.rmse()))?;
    Some(Hypothesis {
        terms: vec![Term::Inertia(0.0)],
        from_given: true,
        ..Hypothesis::new(judged)
    })
}

/// A recursion with its inputs combined into one at their mean delay, which may lie between samples.
fn one_input(frame: &Model, found: Recursion) -> Model {
    let whole: f64 = found.b.iter().sum();
    let moment: f64 = found.b.iter().enumerate().map(|(i, b)| i as f64 * b).sum();
    let later = if whole == 0.0 { 0.0 } else { moment / whole };
    let delay = found.delay as f64 + later;
    linear(frame, found.a, vec![whole], found.constant, delay)
}

fn recursion(frame: &Model, found: Recursion) -> Model {
    linear(frame, found.a, found.b, found.constant, found.delay as f64)
}

fn arx(frame: &Model, arx: &Arx) -> Model {
    let delay = arx.delay.saturating_sub(1) as f64;
    linear(frame, arx.a.to_vec(), arx.b.to_vec(), arx.c, delay)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn baselines_run_as_models_do() {
        let n = 3000;
        let u: Vec<f64> = (0..n)
            .map(|k| f64::from(u8::from(k / 170 % 2 == 1)))
            .collect();
        let (mut fast, mut slow) = (0.0, 0.0);
        let y = (0..n).map(|k: usize| {
            let now = 3.0 + slow;
            let arriving = k.checked_sub(12).map_or(0.0, |k| u[k]);
            fast += (2.0 * arriving - fast) / 8.0;
            slow += (fast - slow) / 60.0;
            now
        });
        let y = y.collect();
        let record = Record::new("r", Use::Identify, 0.001, u, y);
        let record = crate::preparation::Preparation::of(&[record])
            .records
            .remove(0);
        let models = baselines(&Model::default(), &[&record]);
        assert_eq!(models.len(), 3);
        let rms = |model: &Model| {
            let run = model.free_run(&record).expect("stable");
            let squares = run.iter().zip(&record.y).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / n as f64).sqrt()
        };
        assert!(rms(&models[0]) < 0.06, "{}", rms(&models[0]));
        assert!(rms(&models[1]) < 0.03, "{}", rms(&models[1]));
        assert!(rms(&models[2]) < 0.03, "{}", rms(&models[2]));
    }
}
