//! The rules of the verdict.

use crate::rules;
use model_core::recursion::SHORTEST_MEMORY;

rules! {
    /// When a model error is significant, when an effect is named, and when it is only a surrogate.
    pub struct Rules in "diagnose";

    /// If the error of a model is within this factor of a known noise level, the model is adequate. A further
    /// effect is then a surrogate.
    floor_margin: f64 = 1.03, "times the noise level", "20 repeats, pooled over the validation records, give the noise level to 0.4 %; models with the right structure have errors of 0.98 to 1.02 × the noise level";
    /// Level of the tests.
    level: f64 = 0.05, "p-value", "convention";
    /// Family-wise level: the e-value must be at least the inverse of this.
    level_of_search: f64 = 0.02, "p-value", "target: at most 3 % false names";
    /// At a known noise level an effect is left out, or replaced by lags, if the validation error rises by at most this
    /// fraction. At an unknown noise level, no effect is missing if the error of the given model is larger by at most
    /// this fraction.
    worthwhile: f64 = 0.015, "share of the rms error", "in cases without an effect of six families, noise alone \
         changes the error by up to 0.01";
    /// Validation errors that differ by less than this are equal in practice.
    alike: f64 = 0.005, "share of the rms error", "judgement: a tenth of the difference that another noise seed makes";
    /// If the final model is above the noise level, effects are named under two conditions: they explain at least
    /// this share of the unexplained variance, and the remaining error is below the rule `terms.much`. Otherwise
    /// they are surrogates.
    explained: f64 = 0.95, "share of the model error above the noise", "effects with an altered equation leave \
         1 to 4 % unexplained";
    /// Share of the unexplained variance that named effects must explain if the noise level is unknown.
    explained_in_unknown_noise: f64 = 0.75, "share of the model error above the noise", "the public sets";
    /// If a model without the effects is at the noise level, effects that explain less than this share of its
    /// unexplained variance are not named.
    most: f64 = 0.5, "share of the model error above the noise", "on published flows without an effect, a candidate \
         reached 28 nats of evidence and a share of 0.30";
    /// If no model without the effects is at the noise level, effects that explain at least this share are named, or
    /// reported as surrogates.
    stands_in: f64 = 0.25, "share of the model error above the noise", "on published flows, an echo with 241 nats of \
         evidence explains a share of 0.46";
    /// An effect is named or certified although another error remains if its e-value is large enough and it explains
    /// this share of the variance that the best model without it leaves.
    certified_share: f64 = 0.7, "share of the model error above the noise", "six surrogates on simulated rigs: \
         the four right ones explained 0.72 to 1.00, the two wrong ones 0.56 and 0.62";
    /// An effect is a surrogate if the interval of each of its positive parameters spans more than this factor, or if the
    /// interval of its amplitude contains 0: the records do not determine it.
    identified: f64 = 50.0, "times", "judgement; in a model with an edge-dependent delay, the interval of a wrong \
         hysteresis spanned a factor of 180; among 24 right names in published flows and pairs none spanned so much";
    /// Where the level of slow noise is unknown, a model error is significant if this share of it, and not of its
    /// magnitude alone, is a function of a coordinate.
    depends: f64 = 0.1, "share of the model error above the noise", "the public sets";
    /// Where the level of slow noise is unknown, a model error is also significant if it exceeds this share,
    /// because no usable recording is so noisy.
    too_much: f64 = 0.06, "share of the variance of y", "the public sets";
    /// From this number of `validate` records on, every third is set aside for an independent error estimate.
    enough_to_quote: usize = 4, "records", "judgement: at least three records are needed for the choice";
    /// If a measured channel explains at least this cross-validated share of the error, an effect of that channel
    /// is reported as missing.
    follows_a_channel: f64 = 0.25, "share of the model error above the noise", "judgement: smallest share of a surrogate";
    /// A lag shorter than this belongs to the model order and is not reported as a memory.
    shortest_memory: usize = SHORTEST_MEMORY, "samples", "judgement: the time scale of a fast flow at 1 kHz";
    /// A net rate below this share of the rate of the dominant pole is only a difference of lags that cancel. The
    /// rate of the pole is then used.
    cancelled: f64 = 0.01, "share of the rate", "judgement";
}
