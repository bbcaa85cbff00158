//! Host side: recordings to models.

pub mod search;
