//! The picture of a delay study: like Fig. 8 of the ECC 2016 paper.

use super::law::DelayLawFit;
use super::study::DelayStudy;
use crate::data::Use;
use crate::picture::{DelayEdge, DelayLawPlot, LawPoint, MeasuredDelay, Picture, delay_law};

/// Number of points of the curve.
const POINTS: usize = 200;

/// Draws the measured delays of the identify records over ỹ, with the law and its confidence band. Returns SVG.
#[must_use]
pub fn draw_delays(study: &DelayStudy, title: &str, sample_period_s: f64) -> Picture {
    let identify = || study.edges.iter().filter(|e| e.role == Use::Identify);
    let points: Vec<MeasuredDelay> = identify()
        .filter_map(|e| {
            Some(MeasuredDelay {
                y_avg: e.mean_output?,
                delay: e.onset.ok()?.delay,
                edge: if e.edge.rising {
                    DelayEdge::Rising
                } else {
                    DelayEdge::Falling
                },
            })
        })
        .collect();
    let law: Vec<LawPoint> = study.law.iter().flat_map(curve).collect();
    let label = study.law.as_ref().map_or_else(String::new, |law| {
        let (p1, sign) = (law.p1.value, if law.p1.value < 0.0 { '−' } else { '+' });
        format!(
            "{:.2} {sign} {:.2}·exp(−{:.2}·ỹ)",
            law.p0.value,
            p1.abs(),
            law.p2.value
        )
    });
    delay_law(&DelayLawPlot {
        title,
        sample_period_s,
        points: &points,
        law: &law,
        law_label: &label,
        unmeasured: identify().filter(|e| e.onset.is_err()).count(),
    })
}

fn curve(law: &DelayLawFit) -> Vec<LawPoint> {
    let (from, to) = law.range;
    (0..POINTS)
        .map(|i| {
            let y_avg = from + (to - from) * i as f64 / (POINTS - 1) as f64;
            let (low, high) = law.band(y_avg);
            LawPoint {
                y_avg,
                delay: law.at(y_avg),
                low: if low.is_finite() { low } else { f64::NAN },
                high: if high.is_finite() { high } else { f64::NAN },
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{DataSet, Record};
    use crate::delay::{DelayOptions, study_delays};

    #[test]
    fn a_picture_comes_out_of_any_study() {
        let empty = Record::new("r", Use::Identify, 0.001, vec![0.0; 50], vec![0.1; 50]);
        let set = DataSet::from_records(None, vec![empty]).unwrap();
        let study = study_delays(&set, &DelayOptions::default()).unwrap();
        assert!(draw_delays(&study, "none", 0.001).starts_with("<svg"));
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/hidden-ramp");
        let set = DataSet::load(&folder).unwrap();
        let study = study_delays(&set, &DelayOptions::default()).unwrap();
        let svg = draw_delays(&study, "ramp", 0.001);
        assert!(svg.contains("exp(−") && svg.len() > 5_000);
    }
}
