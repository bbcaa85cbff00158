//! The rules of the verdict.

use crate::rules;
use model_core::recursion::SHORTEST_MEMORY;

rules! {
    /// When a misfit counts, when an effect is named, and when it only stands in for something else.
    pub struct Rules in "diagnose";

    /// A misfit below this factor is within what `y_sd` itself is known to.
    floor_margin: f64 = 1.10, "times the noise level", "a standard deviation from 20 repeats is known to 16 % a sample; nulls of six families stay below 1.03";
    /// A given model within this factor of the noise floor is not searched further unless an effect promises what it
    /// takes to be named, and more than chance does.
    at_once: f64 = 1.03, "times the noise level", "what `identify` leaves of nulls is 0.99 to 1.02; lags that imitate an effect leave 1.03 and more";
    /// Level of the tests.
    level: f64 = 0.05, "p-value", "convention";
    /// Level of the whole search: noise alone may let any effect at any point of its grid do as much so often.
    level_of_search: f64 = 0.02, "p-value", "three false names in a hundred are too many";
    /// What promises to be named on a given model at the noise floor is looked at from this p-value on.
    worth_a_search: f64 = 0.1, "p-value", "judgement: one null in ten costs a search";
    /// Effects in the place of something without a name that are followed to the end on a given model at the noise floor.
    settled: usize = 2, "", "judgement: for the time it takes";
    /// An effect must lower the held-out error of the best base without it by this fraction, unless it does as well with
    /// fewer parameters.
    worthwhile: f64 = 0.015, "share of the rms error", "nulls of six families: chance manages 0.01";
    /// Held-out errors that differ by less than this are the same for any purpose.
    alike: f64 = 0.005, "share of the rms error", "judgement: a tenth of what two seeds of noise differ by";
    /// Effects that leave the model above the noise are named if they take at least this share of the excess and leave less than `much` of the
    /// search; otherwise they stand in for something else.
    explained: f64 = 0.95, "share of the model error above the noise", "altered laws leave 1 to 4 % of an excess";
    /// Where the noise is not known, this share of the excess is enough to be named.
    explained_in_unknown_noise: f64 = 0.75, "share of the model error above the noise", "the public sets";
    /// Effects that take less than this share of the excess are not named …
    most: f64 = 0.5, "share of the model error above the noise", "judgement: half";
    /// … and where they leave the model above the noise, they stand in for something else if they take this share.
    stands_in: f64 = 0.25, "share of the model error above the noise", "judgement: nothing is claimed, and the model that is handed over errs less";
    /// An effect beside others whose positive parameters have intervals that span more than this stands in for something else; so does one whose
    /// amplitude may be 0. Alone beside a base that fits, such an effect is not named.
    identified: f64 = 100.0, "times", "judgement; a hysteresis beside the delays of the edges, on a memory that saturates, spanned 180";
    /// Where slow noise is not known, a misfit counts if this share of it depends on something …
    depends: f64 = 0.1, "share of the model error above the noise", "the public sets";
    /// … or if it is more than noise can be in a recording worth fitting.
    too_much: f64 = 0.06, "share of the variance of y", "the public sets";
    /// Where neither the noise is known nor anything shows that the base errs, an effect must lower the error by this.
    worthwhile_in_the_dark: f64 = 0.1, "share of the rms error", "the hair dryer and the gas furnace, where nothing is missing";
    /// Candidates that are refitted for the ranking beside the named ones.
    ranked_in_full: usize = 4, "", "judgement: further ones never matched the leader";
    /// Of so many `validate` records every third is kept back, and the last error is quoted there as well.
    enough_to_quote: usize = 4, "records", "judgement: fewer than three to choose by are too few";
    /// An error of which a measured channel explains this share, cross-validated, is not without a cause: something is
    /// missing, and it is in the file.
    follows_a_channel: f64 = 0.25, "share of the model error above the noise", "judgement: what an effect must take to stand in";
    /// A lag below this is the order of the flow, not a memory.
    shortest_memory: usize = SHORTEST_MEMORY, "samples", "judgement: as long as a fast flow takes; the model's own";
    /// A rate below this share of that of the way back is what lags leave that cancel: it is no rate.
    cancelled: f64 = 0.01, "share of the rate", "judgement";
}
