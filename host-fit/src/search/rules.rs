//! The rules of the mesh search.

use crate::rules;

rules! {
    /// Parameters of the mesh search for delays.
    pub struct Rules in "search";

    /// Most evaluations of the objective; points remembered from before cost nothing.
    evaluations: usize = 20_000, "", "judgement: minutes";
    /// The first poll reaches this far.
    initial_frame: f64 = 0.1, "share of each variable's range", "NOMAD's default";
    /// A success makes the frame of a variable larger that it moved by more than this.
    anisotropy: f64 = 0.1, "share of the frame", "NOMAD's default";
    /// After a success the same step is tried once more, this many times as long.
    speculative: f64 = 4.0, "times", "NOMAD's default";
    /// Fruitless kicks out of a local optimum grow from this …
    least_kick: f64 = 0.02, "share of each variable's range", "judgement";
    /// … to this.
    largest_kick: f64 = 0.3, "share of each variable's range", "judgement";
}
