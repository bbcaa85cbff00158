//! The workbench's server: a page over a project folder, for one person at one machine.
//!
//! It knows nothing of models. What can be done is a [`Bench`]; this crate brings requests to it safely ([`guard`](self)), runs one
//! piece of work at a time with its progress told to every page that is open ([`Work`]), and keeps the tree of what was made and
//! the log of how on disk ([`Project`]).

mod guard;
mod intake;
mod project;
mod server;
mod work;

pub use project::{Node, Project, ProjectError, beneath};
pub use server::{Bench, Download, Refusal, serve};
pub use work::Work;
