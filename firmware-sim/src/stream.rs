//! Independent streams of random numbers under one seed, so that one draw more here changes nothing there.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// What the numbers are for. The order is part of every data set: new streams go to the end.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stream {
    Base,
    Effects,
    Commands,
    Tunnel,
    Noise,
    Instrument,
    Nuisances,
}

pub(crate) fn stream(seed: u64, which: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(which as u64);
    rng
}
