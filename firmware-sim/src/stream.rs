//! Independent streams of random numbers under one seed: a further draw from one stream does not change the others.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The purposes of the streams. Their order is part of every data set, so new streams are appended.
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
