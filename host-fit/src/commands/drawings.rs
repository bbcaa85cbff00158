//! Results as pictures.

use closed_loop::Trace;
use host_fit::data::{Plant, Record};
use host_fit::design::{Margin, Proof};
use host_fit::diagnose::{Diagnosis, RULES, Ranked};
use host_fit::experiment::Separation;
use host_fit::indicators::ErrorKind;
use host_fit::picture::{
    Candidate, ClosedLoop, LabelledRun, Ladder, LadderRecord, LadderStep, LoopRun, Overlay,
    Picture, Ranking, Region, Regions, closed_loop, ladder, overlay, ranking, regions, significant,
};
use host_fit::simulate::Signals;
use host_fit::steps::effect_in_words;

use super::page_parts::measured;
use super::words::{is_told, named_first, role_name};

/// One picture per record: measurement and free runs, labelled.
pub(crate) fn overlays(records: &[Record], runs: &[(&str, &[Vec<f64>])]) -> Vec<(String, Picture)> {
    let picture = |(index, record): (usize, &Record)| {
        let models: Vec<LabelledRun<'_>> = runs
            .iter()
            .filter_map(|(label, runs)| {
                let y = runs.get(index)?;
                Some(LabelledRun { label, y })
            })
            .collect();
        let title = format!("{} ({})", record.name, role_name(record.role));
        let svg = overlay(&Overlay {
            title: &title,
            y_label: "friction gain y",
            models: &models,
            ..measured(record)
        });
        (record.name.clone(), svg)
    };
    records.iter().enumerate().map(picture).collect()
}

/// Heading of a ladder, for example "Validation error, step by step".
pub(crate) fn step_by_step(kind: ErrorKind) -> String {
    format!("{}, step by step", kind.title())
}

/// The error step by step, as a picture.
pub(crate) fn ladder_picture(diagnosis: &Diagnosis) -> Picture {
    let finite = diagnosis
        .ladder
        .iter()
        .filter(|rung| rung.validate_rmse.is_finite());
    let steps: Vec<LadderStep<'_>> = finite
        .map(|rung| LadderStep {
            label: &rung.step,
            rmse: rung.validate_rmse,
        })
        .collect();
    let records: [LadderRecord<'_>; 0] = [];
    let kind = diagnosis.held_out_by.compared();
    ladder(&Ladder {
        title: &step_by_step(kind),
        error: kind.title(),
        scored: kind.records(),
        y_unit: "y",
        steps: &steps,
        records: &records,
        noise_rmse: diagnosis.ladder.last().and_then(|rung| rung.noise_rmse),
    })
}

/// The error of the given model and that of the final one, as two bars. All steps are drawn if no effect was added, or if
/// the given model fits as well as the final one: then the answer compares with a step between them.
pub(crate) fn before_and_after_picture(diagnosis: &Diagnosis) -> Picture {
    let [given, between @ .., last] = diagnosis.ladder.as_slice() else {
        return ladder_picture(diagnosis);
    };
    let falls = last.validate_rmse <= (1.0 - RULES.worthwhile) * given.validate_rmse;
    if between.is_empty() || last.effects.is_empty() || !falls {
        return ladder_picture(diagnosis);
    }
    let bars = [given, last].map(|rung| (rung.step.as_str(), rung.validate_rmse));
    errors_picture(diagnosis.held_out_by.compared(), &bars, last.noise_rmse)
}

/// The errors of several models as bars.
pub(crate) fn errors_picture(
    kind: ErrorKind,
    bars: &[(&str, f64)],
    noise_rmse: Option<f64>,
) -> Picture {
    let finite = bars.iter().filter(|(_, rmse)| rmse.is_finite());
    let steps: Vec<LadderStep<'_>> = finite
        .map(|&(label, rmse)| LadderStep { label, rmse })
        .collect();
    ladder(&Ladder {
        title: kind.title(),
        error: kind.title(),
        scored: kind.records(),
        y_unit: "y",
        steps: &steps,
        records: &[],
        noise_rmse,
    })
}

/// The discriminating experiment: its command and the prediction of each model.
pub(crate) fn experiment_picture(separation: &Separation) -> Picture {
    let experiment = &separation.experiment;
    let named = separation.effects.len() == separation.models.len();
    let numbered = separation.models.iter().enumerate();
    let expected = numbered.filter_map(|(index, model)| {
        let y = model
            .run_free(&Signals::commanded(model, &experiment.u))
            .ok()?;
        // An alternative to an effect may be a lag, which is not among a model's effects.
        let label = match separation.effects.get(index).filter(|_| named) {
            Some(effect) => effect.clone(),
            None => model.effect_names().join(" + "),
        };
        Some((label, y))
    });
    let expected: Vec<(String, Vec<f64>)> = expected.collect();
    let runs: Vec<LoopRun<'_>> = expected
        .iter()
        .enumerate()
        .map(|(index, (label, y))| LoopRun {
            label,
            y,
            // All models get the same command.
            u: if index == 0 { &experiment.u } else { &[] },
            air: &[],
        })
        .collect();
    let apart = |k: &usize| {
        let values = expected.iter().filter_map(|(_, y)| y.get(*k));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
            (low.min(*y), high.max(*y))
        });
        high - low
    };
    let most = (0..experiment.u.len()).max_by(|a, b| apart(a).total_cmp(&apart(b)));
    let most_s = most.unwrap_or_default() as f64 * experiment.sample_period_s;
    closed_loop(&ClosedLoop {
        title: "Prediction of each model, where the models differ most",
        y_label: "friction gain y",
        air_label: "",
        sample_period_s: experiment.sample_period_s,
        reference: &[],
        runs: &runs,
        window_s: Some(((most_s - 0.5).max(0.0), most_s + 0.5)),
    })
}

/// The law and its reference on the same plant.
pub(crate) fn proof_picture(proof: &Proof, tracks: bool) -> Picture {
    let runs = [
        (proof.compared_name, &proof.compared),
        ("the designed law", &proof.trace),
    ];
    let reference: Vec<f64> = match tracks {
        true => proof.trace.samples.iter().map(|s| s.reference).collect(),
        false => Vec::new(),
    };
    loop_picture(&LoopPicture {
        title: "The law on the model, noisy sensor",
        air: true,
        reference: &reference,
        runs: &runs,
        // The picture shows a quarter of a trial, so that single pulses are visible.
        seconds: 0.25 * proof.trace.samples.len() as f64 * proof.trace.sample_period_s,
    })
}

/// The tolerated errors of the model, two at a time.
pub(crate) fn margin_picture(margin: &Margin) -> Picture {
    let percent = |contour: &[[f64; 2]]| -> Vec<[f64; 2]> {
        contour
            .iter()
            .map(|point| point.map(|share| 100.0 * share))
            .collect()
    };
    let planes: Vec<([String; 2], Vec<[f64; 2]>)> = margin
        .planes
        .iter()
        .map(|plane| {
            (
                plane.errors.map(|error| format!("{error}, %")),
                percent(&plane.contour),
            )
        })
        .collect();
    let each: Vec<Region<'_>> = planes
        .iter()
        .map(|([across, up], contour)| Region {
            across,
            up,
            contour,
        })
        .collect();
    regions(&Regions {
        title: "Robustness margin: how far the plant may differ from the model",
        inside: "attachment kept, rms error within twice that on the model",
        centre: "the model",
        regions: &each,
    })
}

/// Several controllers on one flow.
pub(crate) struct LoopPicture<'a> {
    pub(crate) title: &'a str,
    /// Whether the air used is shown.
    pub(crate) air: bool,
    /// Reference of y; empty without a reference.
    pub(crate) reference: &'a [f64],
    /// Names of the controllers with their runs.
    pub(crate) runs: &'a [(&'a str, &'a Trace)],
    /// Duration shown, s.
    pub(crate) seconds: f64,
}

pub(crate) fn loop_picture(picture: &LoopPicture<'_>) -> Picture {
    struct Series {
        y: Vec<f64>,
        u: Vec<f64>,
        air: Vec<f64>,
    }
    let series = |trace: &Trace| {
        let on = trace.samples.iter().map(|s| f64::from(u8::from(s.on)));
        let used = |sum: &mut f64, on: f64| {
            *sum += on * trace.sample_period_s;
            Some(*sum)
        };
        Series {
            y: trace.samples.iter().map(|s| s.friction).collect(),
            air: if picture.air {
                on.clone().scan(0.0, used).collect()
            } else {
                Vec::new()
            },
            u: on.collect(),
        }
    };
    let all: Vec<(&str, Series)> = picture
        .runs
        .iter()
        .map(|(label, trace)| (*label, series(trace)))
        .collect();
    let runs: Vec<LoopRun<'_>> = all
        .iter()
        .map(|(label, series)| LoopRun {
            label,
            y: &series.y,
            u: &series.u,
            air: &series.air,
        })
        .collect();
    closed_loop(&ClosedLoop {
        title: picture.title,
        y_label: "friction gain y",
        air_label: "",
        sample_period_s: picture
            .runs
            .first()
            .map_or(0.0, |(_, trace)| trace.sample_period_s),
        reference: picture.reference,
        runs: &runs,
        window_s: Some((0.0, picture.seconds)),
    })
}

/// How the errors of the candidates and of their base model were obtained.
pub(super) fn candidates_caption(diagnosis: &Diagnosis) -> String {
    let error = diagnosis.held_out_by.judged().name();
    let runs = diagnosis.restarted_s.map_or_else(
        || "free runs".to_owned(),
        |seconds| format!("runs restarted every {} s", significant(seconds, 3)),
    );
    format!(
        "Each effect alone is added to the same base model and refitted together with all other parameters. The grey \
         line is the base model without the candidate. All values are {error}s of {runs}."
    )
}

/// Every candidate's error.
pub(super) fn ranking_picture(diagnosis: &Diagnosis, plant: Plant) -> Picture {
    let kind = diagnosis.held_out_by.judged();
    let ranked = named_first(diagnosis).into_iter();
    let ranked: Vec<_> = ranked.filter(|r| is_told(r, diagnosis)).collect();
    let names: Vec<String> = ranked
        .iter()
        .map(|r| effect_in_words(&r.effect, plant))
        .collect();
    let candidate = |(r, name)| {
        let r: &Ranked = r;
        let name: &String = name;
        Candidate {
            name,
            rmse: r.validate_rmse,
            low: f64::NAN,
            high: f64::NAN,
            accepted: diagnosis.missing.contains(&r.effect),
            note: match r.significant || diagnosis.missing.contains(&r.effect) {
                true => "",
                false if r.p_value > RULES.level => "not significant",
                false => "below the practical margin",
            },
        }
    };
    let candidates: Vec<Candidate<'_>> = ranked.into_iter().zip(&names).map(candidate).collect();
    ranking(&Ranking {
        title: &format!("{} with each effect", kind.title()),
        y_unit: "y",
        error: kind.title(),
        candidates: &candidates,
        base_rmse: Some(diagnosis.candidates_base_rmse),
        noise_rmse: diagnosis.ladder.last().and_then(|rung| rung.noise_rmse),
    })
}
