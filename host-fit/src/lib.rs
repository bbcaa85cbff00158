//! Host side: recordings to models.

pub mod data;
pub mod output;
pub mod search;
