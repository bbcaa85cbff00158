//! Identification.
mod arrival;
mod cholesky;
mod exchange;
mod lagged_products;
mod layout;
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
