//! A control law from a model, and the law tried in the loop.

use serde::Serialize;

use super::StepError;
use crate::design::{
    MaximiseRequest, Optimum, Proof, TrackDesign, TrackRequest, Trial, maximise, prove,
    prove_pulses, track,
};
use crate::model::{Law, Model};
use closed_loop::Controlled;

/// What a law is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DesignRequest {
    /// Hold the friction at a value.
    Track(TrackRequest),
    /// The most friction for the air.
    Maximise(MaximiseRequest),
}

/// A designed law. Serialises to the keys of `design --json`, those of the trials left out: they are a [`Proof`]'s.
#[derive(Clone, Debug, Serialize)]
pub struct Design {
    /// The model with its law.
    #[serde(skip)]
    pub model: Model,
    /// The law.
    pub law: Law,
    /// What the design rests on.
    #[serde(flatten)]
    pub outcome: DesignOutcome,
}

/// What a design rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DesignOutcome {
    /// Of a tracking law.
    Track(TrackDesign),
    /// Of a maximising law.
    Maximise(Optimum),
}

impl Design {
    /// The same design, whose law says in which trials attachment was lost.
    #[must_use]
    pub fn which_lost(self, trials: Vec<String>) -> Self {
        let law = self.law.which_lost(trials);
        Self {
            model: Model {
                law: Some(law.clone()),
                ..self.model
            },
            law,
            outcome: self.outcome,
        }
    }
}

/// Designs the law that `request` asks for and puts it into the model.
///
/// ```
/// use host_fit::design::TrackRequest;
/// use host_fit::model::{Law, Model};
/// use host_fit::steps::{DesignOutcome, DesignRequest, design};
///
/// let model = Model::load("../data/paper/table-2-state-dependent.toml".as_ref())?;
/// let request = DesignRequest::Track(TrackRequest::holding(0.8));
/// // Only the one-step convention is stable under steady blowing.
/// let model = Model { convention: model_core::recursion::LagConvention::OneStep, ..model };
/// let designed = design(&model, &request)?;
/// let DesignOutcome::Track(track) = &designed.outcome else { unreachable!() };
/// assert!((track.equivalent_duty - 0.713).abs() < 1e-3);
/// assert!(matches!(designed.model.law, Some(Law::Track(_))));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError::Design`] with the reason: out of reach, a model that does not settle, not from rest, not at 1 kHz.
pub fn design(model: &Model, request: &DesignRequest) -> Result<Design, StepError> {
    let (law, outcome) = match request {
        DesignRequest::Track(request) => {
            let design = track(model, request)?;
            (Law::Track(design.law.clone()), DesignOutcome::Track(design))
        }
        DesignRequest::Maximise(request) => {
            let optimum = maximise(model, request)?;
            let law = Law::Maximise(optimum.law.clone());
            (law, DesignOutcome::Maximise(optimum))
        }
    };
    Ok(Design {
        model: Model {
            law: Some(law.clone()),
            ..model.clone()
        },
        law,
        outcome,
    })
}

/// Tries the law of `design` on the flow as it is expected (`plant`) and on others; a tracking law also on its own
/// model. `blown` is the friction of the expected flow under steady blowing, y.
pub fn try_out<F>(design: &Design, blown: f64, plant: &Trial<F>, others: &[Trial<F>]) -> Proof
where
    F: Controlled + Clone + Sync,
{
    match &design.law {
        Law::Track(law) => prove(&design.model, law, plant, others),
        Law::Maximise(law) => prove_pulses(law, blown, plant, others),
    }
}
