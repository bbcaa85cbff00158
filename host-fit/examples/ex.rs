//! Experiment.
use host_fit::data::*;
use host_fit::fit::*;
use host_fit::model::*;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let data = DataSet::load(std::path::Path::new(&args[1])).unwrap();
    let identify: Vec<&Record> = data.identify().collect();
    let validate: Vec<&Record> = data.validate().collect();
    let law = args.get(2).is_some_and(|a| a == "fixed");
    let given = Model {
        sample_period_s: data.sample_period_s,
        convention: Default::default(),
        averaging: model_core::model::Averaging{window:250, averaged_model:false},
        start: Start::Rest, constant: 0.0, state_lags: vec![1], a: vec![0.98], product_lags: vec![1], b: vec![0.02], c: vec![0.0],
        delay: if law { Delay::Fixed{delays: vec![40]} } else { Delay::StateDependent{delay_floor:35.0, delay_rise:10.0, delay_rate: 6.0, factors: vec![1.0]} },
        effects: vec![], training: Training::default(),
    };
    let rmse = |m: &Model, rs: &[&Record]| {
        let own: Vec<Record> = rs.iter().map(|r| (*r).clone()).collect();
        host_fit::indicators::score(m, &own).map(|(s, _)| s.validate.or(s.identify).unwrap()).map(|i| (i.rmse, i.noise_rmse)).unwrap_or((f64::NAN, None))
    };
    let t = Instant::now();
    let base = lean_base(&given, &identify).unwrap();
    let (r, n) = rmse(&base.model, &validate);
    println!("base {:.5} noise {:?} identify {:.5} {:?} {:?} in {:?}", r, n, (base.sum_of_squares/base.samples as f64).sqrt(), base.model.delay, base.model.values(), t.elapsed());
    let t = Instant::now();
    for spec in model_core::effects::SPECS {
        let t1 = Instant::now();
        match fit_with_effect(&base.model, spec, &identify, &FitOptions::default()) {
            Ok(fit) => { let (r, _) = rmse(&fit.model, &validate);
              let p: Vec<String> = fit.model.coordinates().iter().enumerate().filter(|(_, c)| c.parameter().is_some()).map(|(i, c)| format!("{}={:.4}±{:.4}", c.name, fit.model.values()[i], fit.standard_error(i).unwrap_or(f64::NAN))).collect();
              println!("{:26} {:.5} id {:.5} it {} {:?} {}", spec.name, r, (fit.sum_of_squares/fit.samples as f64).sqrt(), fit.iterations, t1.elapsed(), p.join(" ")); }
            Err(e) => println!("{:26} {e}", spec.name),
        }
    }
    println!("all {:?}", t.elapsed());
}
