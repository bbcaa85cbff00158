//! Identification.
mod arrival;
mod cholesky;
mod exchange;
mod free_run;
mod free_run_steps;
mod lagged_products;
mod layout;
mod linearised;
mod one_step;
mod regression;
mod structure;
pub use structure::*;

#[doc(hidden)]
pub fn scratch(records: &[Series<'_>], structure: &Structure, seed: u64, starts: usize, patience: usize) {
    use crate::search::*;
    use std::time::Instant;
    let t0 = Instant::now();
    let regression = regression::Regression::new(records, structure);
    let t1 = t0.elapsed();
    let mut problem = one_step::OneStep { regression };
    let mut steps: Vec<Box<dyn SearchStep<one_step::OneStep>>> = vec![
        Box::new(one_step::ExchangeStep::default()),
        Box::new(one_step::PairStep::default()),
        Box::new(one_step::KickStep::new(patience)),
    ];
    let settings = Settings { seed, ..Settings::default() };
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let starts: Vec<Point> = (0..starts)
        .map(|_| problem.variables().iter().map(|v| rng.random_range(v.lower..=v.upper)).collect())
        .collect();
    let report = minimise(&mut problem, &starts, &mut steps, &settings, &(), &std::sync::atomic::AtomicBool::new(false));
    let best = report.best.unwrap();
    let d = problem.regression.layout.delays(&best.point);
    let (_, exact) = problem.regression.exact(&d).unwrap();
    println!("seed {seed} {:.7} exact {exact:.7} evals {} screened {} {:?} tables {:?} total {:?}\n  {:?} {:?} {:?} hist {:?}",
        best.value, report.evaluations, report.screened, report.stop, t1, t0.elapsed(), d.state, d.product, d.ticks, report.history.iter().map(|h|h.1).collect::<Vec<_>>());
}

#[doc(hidden)]
pub fn scratch_free(records: &[Series<'_>], structure: &Structure, seed: u64, truth: (&[u16], &[u16])) {
    use crate::search::*;
    use std::time::Instant;
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut regression = regression::Regression::new(records, structure);
    let runner = free_run::FreeRunner::new(&regression.signals, structure);
    let start: Point = regression.layout.variables.iter().map(|v| rng.random_range(v.lower..=v.upper)).collect();
    let mut d = regression.layout.delays(&start);
    let mut n = 0;
    one_step::settle(&mut regression, &mut d, None, &mut n);
    regression.tabulate(&d.ticks);
    let problem = free_run::FreeRun { regression, runner };
    let t = Instant::now();
    println!("one-step optimum {:?}", problem.epsilon(&d, f64::INFINITY));
    println!("one eval {:?}", t.elapsed());
    let tr = layout::Delays { state: truth.0.to_vec(), product: truth.1.to_vec(), ticks: d.ticks.clone() };
    println!("truth {:?} onestep {}", problem.epsilon(&tr, f64::INFINITY), problem.regression.normal(&tr).squared_residual().sqrt());

    let t = Instant::now();
    let lin = problem.linearise(&d).unwrap();
    if std::env::var("BENCH").is_ok() { for _ in 0..30 { problem.linearise(&d).unwrap(); } return; }
    println!("linearise {:?} self {}", t.elapsed(), lin.predict(&problem.regression, &d).sqrt());
    let slots = exchange::Exchange::new(&problem.regression, &d.ticks).slots(&d);
    let mut pairs = vec![];
    let t = Instant::now();
    for slot in &slots { for lag in 1..=500u16 {
        let mut trial = d.clone();
        exchange::set(&mut trial, *slot, lag);
        pairs.push((lin.predict(&problem.regression, &trial).sqrt(), trial));
    } }
    println!("predict {} {:?}", pairs.len(), t.elapsed());
    let t = Instant::now();
    let mut both: Vec<(f64, f64)> = pairs.iter().map(|(p, d)| match problem.epsilon(d, f64::INFINITY) { Evaluation::Value(v) => (*p, v), _ => (*p, 1e9) }).collect();
    println!("sim {:?}", t.elapsed());
    both.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("by predicted {:?}", &both[..20]);
    both.sort_by(|a, b| a.1.total_cmp(&b.1));
    println!("by actual {:?}", &both[..20]);
    let mut preds: Vec<f64> = both.iter().map(|b| b.0).collect();
    preds.sort_by(f64::total_cmp);
    let rank = |p: f64| preds.iter().position(|x| *x >= p).unwrap();
    println!("ranks of winners {:?}", both.iter().take(60).map(|b| rank(b.0)).collect::<Vec<_>>());
    println!("better than incumbent {}", both.iter().filter(|b| b.1 < 9.0992).count());
    let mut ones: Vec<(f64, f64, String)> = pairs.iter().map(|(p, d)| (*p, problem.epsilon(d, f64::INFINITY), format!("{:?}", d))).map(|(p, e, s)| (p, match e { Evaluation::Value(v) => v, _ => 1e9 }, s)).collect();
    ones.sort_by(|a, b| a.1.total_cmp(&b.1));
    for o in ones.iter().take(400).step_by(8) { println!("{o:?}"); }
}

#[doc(hidden)]
pub fn scratch_free2(records: &[Series<'_>], structure: &Structure, seed: u64, patience: usize) {
    use crate::search::*;
    use std::time::Instant;
    use rand::{RngExt, SeedableRng};
    let t = Instant::now();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut regression = regression::Regression::new(records, structure);
    let runner = free_run::FreeRunner::new(&regression.signals, structure);
    let start: Point = regression.layout.variables.iter().map(|v| rng.random_range(v.lower..=v.upper)).collect();
    let mut d = regression.layout.delays(&start);
    let mut n = 0;
    one_step::settle(&mut regression, &mut d, None, &mut n);
    let start = regression.layout.point(&d);
    let mut problem = free_run::FreeRun { regression, runner };
    let mut steps: Vec<Box<dyn SearchStep<free_run::FreeRun>>> = vec![
        Box::new(free_run_steps::PredictedStep::default()),
        Box::new(free_run_steps::FreeKickStep::new(patience)),
    ];
    let settings = Settings { seed, evaluations: 100000, ..Settings::default() };
    let report = minimise(&mut problem, &[start], &mut steps, &settings, &(), &std::sync::atomic::AtomicBool::new(false));
    let best = report.best.unwrap();
    let d = problem.regression.layout.delays(&best.point);
    println!("seed {seed} {:.7} evals {} screened {} {:?} total {:?}\n  {:?} {:?} {:?} hist {:?}",
        best.value, report.evaluations, report.screened, report.stop, t.elapsed(), d.state, d.product, d.ticks, report.history.iter().map(|h|(h.0, (h.1*1e4).round()/1e4)).collect::<Vec<_>>());
}
