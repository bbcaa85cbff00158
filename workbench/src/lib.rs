//! The workbench's server: a page for a project folder, for one person on one machine.
//!
//! It does not depend on models. The available actions are a [`Bench`]. This crate passes requests to it safely
//! ([`guard`](self)), runs one task at a time and sends its progress to every open page ([`Work`]), and stores the
//! tree of models and the log of commands ([`Project`]).

mod guard;
mod intake;
mod project;
mod server;
mod work;

pub use project::{Node, Project, ProjectError, beneath};
pub use server::{Bench, Download, Refusal, serve};
pub use work::Work;
