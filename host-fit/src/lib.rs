//! Host side: recordings to models.

pub mod codegen;
pub mod delay;
pub mod design;
pub mod diagnose;
pub mod dual;
pub mod excitation;
pub mod experiment;
pub mod extend;
pub mod fit;
pub mod identify;
pub mod indicators;
pub mod model;
pub mod picture;
pub mod power;
pub mod residual;
pub mod rules;
pub mod search;
pub mod simulate;
pub mod steps;
pub mod target;
pub mod user_effect;

pub mod terms;

mod linalg;

pub use recordings as data;
pub use recordings::output;
