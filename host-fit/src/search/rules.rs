//! The rules of the mesh search.

use crate::rules;

rules! {
    /// Parameters of the mesh search for delays.
    pub struct Rules in "search";

    /// Largest number of evaluations of the objective; cached points are free.
    evaluations: usize = 20_000, "", "judgement: minutes";
    /// Initial frame size.
    initial_frame: f64 = 0.1, "share of each variable's range", "NOMAD's default";
    /// After a success the frame grows for variables that moved by more than this.
    anisotropy: f64 = 0.1, "share of the frame", "NOMAD's default";
    /// After a success the same step is tried with this multiple of its length.
    speculative: f64 = 4.0, "times", "NOMAD's default";
    /// Smallest kick (random perturbation) out of a local optimum; kicks grow while they are unsuccessful.
    least_kick: f64 = 0.02, "share of each variable's range", "judgement";
    /// Largest kick out of a local optimum.
    largest_kick: f64 = 0.3, "share of each variable's range", "judgement";
}
