//! A control law in words.

use super::Words;
use closed_loop::Figures;
use host_fit::design::{Optimum, Proof, RULES, TrackDesign};
use host_fit::steps::{Design, DesignOutcome};

impl Words for Design {
    fn words(&self) -> String {
        match &self.outcome {
            DesignOutcome::Track(design) => track_words(design),
            DesignOutcome::Maximise(optimum) => optimum_words(optimum),
        }
    }
}

impl Words for Proof {
    fn words(&self) -> String {
        case_table(self)
    }
}

fn track_words(design: &TrackDesign) -> String {
    let law = &design.law;
    let mut text = format!(
        "holds {} of the interval ({:.3}, {:.3}); duty {:.3} on the model, u_eq = {:.3}\n\
         shortest times {} ms open, {} ms closed; looks up to {} ms ahead",
        law.reference,
        law.reachable[0],
        law.reachable[1],
        design.duty,
        design.equivalent_duty,
        law.hold.on,
        law.hold.off,
        law.look_ahead
    );
    for remark in &design.remarks {
        text.push_str("\nnote: ");
        text.push_str(remark);
    }
    text
}

fn optimum_words(optimum: &Optimum) -> String {
    let law = &optimum.law;
    let mut text = if law.period == 1 {
        format!("best: steady blowing, mean friction {:.3}", optimum.mean)
    } else {
        let pulses: Vec<String> = law
            .pulses
            .iter()
            .map(|(first, length)| format!("{length} ms from {first} ms"))
            .collect();
        format!(
            "best: period {} ms, open {}; mean friction {:.3} with {:.1} % of the air ({} under steady blowing)",
            law.period,
            pulses.join(" and "),
            optimum.mean,
            100.0 * optimum.duty,
            optimum
                .steady_mean
                .map_or("the model grows".to_owned(), |mean| format!("{mean:.3}"))
        )
    };
    text.push_str(&format!(
        "\nafter four minutes {:.3}; with the period 2 % off {:.3}; pole moduli {:.5} closed, {:.5} open",
        optimum.mean_after_minutes, optimum.mean_detuned, optimum.moduli[0], optimum.moduli[1]
    ));
    if optimum.mean_detuned < 0.9 * optimum.mean {
        text.push_str(
            "\nnote: a sharp resonance of the model; try it on the rig before relying on it",
        );
    }
    if let Some(mean) = optimum.refused_mean {
        text.push_str(&format!(
            "\nrefused: {} pulse trains that looked better (up to {mean:.3}) but grow in a long run: instabilities of the model",
            optimum.refused
        ));
    }
    if let Some(planned) = &optimum.planned {
        text.push_str(&format!(
            "\nfree commands over {} s from rest ({}, every {:.0} ms): value {:.3} with {:.1} % of the air (steady blowing {:.3}); {}",
            planned.horizon_s,
            if planned.exact { "all tried" } else { "beam search" },
            1000.0 * planned.block_s,
            planned.value,
            100.0 * planned.duty,
            planned.steady_value,
            match planned.cycle_s {
                None => "planning again and again, the valve comes to rest or the model grows".to_owned(),
                Some(cycle_s) => format!(
                    "planning again and again runs into a cycle of {:.0} ms ({:.0} % of it irregular), tried with the others",
                    1000.0 * cycle_s,
                    100.0 * planned.irregular
                ),
            }
        ));
    }
    match &optimum.outside {
        None => text.push_str("\nnote: the model file says nothing of what was recorded; the optimum may be an extrapolation"),
        Some(outside) if outside.is_inside() => text.push_str("\ninside what was recorded"),
        Some(outside) => text.push_str(&format!(
            "\noutside what was recorded: friction by {:.3}, duty by {:.3}, on-times by a factor {:.2}",
            outside.friction, outside.duty, outside.on_time_factor
        )),
    }
    text
}

fn case_table(proof: &Proof) -> String {
    let mut text = format!(
        "{:<44} {:>6} {:>6} {:>7} {:>6} {:>6} {:>6} {:>7} {:>6}  attachment",
        "in the loop, from 4 s to 12 s",
        "mean",
        "rms",
        "offset",
        "p2p",
        "sw/s",
        "air",
        "settle",
        "steady"
    );
    let mut line = |name: &str, f: &Figures, steady: Option<f64>, kept: Option<bool>| {
        let settling = f
            .settling_s
            .map_or("never".to_owned(), |s| format!("{s:.2} s"));
        let steady = steady.map_or(String::new(), |s| format!("{s:.3}"));
        let kept = match kept {
            Some(true) => "kept",
            Some(false) => "LOST",
            None => "",
        };
        let name: String = name.chars().take(44).collect();
        text.push_str(&format!(
            "\n{name:<44} {:>6.3} {:>6.3} {:>+7.3} {:>6.3} {:>6.1} {:>6.3} {settling:>7} {steady:>6}  {kept}",
            f.mean, f.rms, f.offset, f.peak_to_peak, f.switches_per_s, f.air
        ));
    };
    for case in &proof.cases {
        line(
            &case.name,
            &case.figures,
            Some(case.steady),
            Some(case.kept),
        );
    }
    line(
        proof.compared_name,
        &Figures::of(&proof.compared, RULES.trial_from),
        None,
        None,
    );
    text
}
