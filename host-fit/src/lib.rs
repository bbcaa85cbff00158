//! From recordings of an on/off actuator and a sensor to a model with delayed inputs, to the physical effect that it
//! lacks, to a control law and to Rust constants for a microcontroller.
//!
//! [`steps`] contains the workflow, one function per step; each returns plain data that serialise to the program's
//! JSON output:
//!
//! ```no_run
//! use host_fit::data::DataSet;
//! use host_fit::design::TrackRequest;
//! use host_fit::steps::{self, DelayKind, DesignRequest, IdentifyRequest};
//!
//! let set = DataSet::load("data/hidden-ramp".as_ref())?;
//! let delay = Some(DelayKind::StateDependent);
//! let request = IdentifyRequest { delay, ..IdentifyRequest::default() };
//! let model = steps::identify(&set, &request, &())?.model;
//! let compared = steps::compare(&model, &set)?;
//! println!("{}", serde_json::to_string_pretty(&compared)?);
//! let finding = steps::diagnose(&model, &set, &Default::default(), &())?;
//! println!("{}", finding.answer.words());
//! let extension = steps::extend(&model, &set, &finding.diagnosis.missing, &())?;
//! let goal = DesignRequest::Track(TrackRequest::holding(0.7));
//! let design = steps::design(&extension.model, &goal)?;
//! design.model.save("controlled.toml".as_ref())?;
//! std::fs::write("identified.rs", steps::constants(&design.model)?.text)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The modules, from top to bottom; each uses only the modules below it:
//!
//! | module | does |
//! |---|---|
//! | [`steps`] | the workflow, step by step, with the results as data |
//! | [`codegen`], [`design`], [`extend`] | uses of a model: code generation, control laws, added effects |
//! | [`diagnose`], [`power`] | which effect is missing, with its confidence; the detectable size of an effect |
//! | [`discover`] | a missing term that is not in the catalogue |
//! | [`curves`] | curves in free form, in place of an equation |
//! | [`terms`] | one search over lags, the sensor's offset and effects |
//! | [`experiment`], [`residual`] | the command that distinguishes models best; where a model fails |
//! | [`analysis`] | residual correlations and spectrum, step responses, poles |
//! | [`preparation`] | how records begin, where they rest, which samples are scored |
//! | [`identify`], [`delay`], [`excitation`] | structure and coefficients, measured delays, and excitation of recordings |
//! | [`fit`], [`search`] | parameters by Levenberg–Marquardt on the free run, delays by mesh-adaptive direct search |
//! | [`indicators`], [`simulate`], [`target`] | free runs over records, and their errors |
//! | [`baseline`] | usual linear models of the same records: first and second order with dead time, ARX(2,2) |
//! | [`noise`] | the noise model, which whitens the errors |
//! | [`model`], [`user_effect`] | a model and its file; effects that users define |
//! | [`picture`] | drawings and pages made of plain numbers |
//! | [`averages`], [`dual`], [`data`], [`output`], [`mod@rules`] | moving averages, derivatives, recordings, atomic output files, thresholds |

pub mod analysis;
pub mod averages;
pub mod baseline;
pub mod codegen;
pub mod curves;
pub mod delay;
pub mod design;
pub mod diagnose;
pub mod discover;
pub mod dual;
pub mod excitation;
pub mod experiment;
pub mod extend;
pub mod fit;
pub mod identify;
pub mod indicators;
pub mod model;
pub mod noise;
pub mod picture;
pub mod power;
pub mod preparation;
pub mod residual;
pub mod ring;
pub mod search;
pub mod simulate;
pub mod steps;
pub mod target;
pub mod terms;
pub mod user_effect;

mod order;
mod parallel;

pub use recordings as data;
pub use recordings::output;
pub use recordings::rules;
