//! Changes of records that do not change their information.

use super::records::{Base, Part, normal};
use firmware_sim::named;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

named! {
    /// A change of a data set that must not change the answer.
    #[derive(Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Change {
        /// y → a·y + b.
        Output = "output",
        /// u → α·u + β.
        Command = "command",
        /// u → 1 − u.
        Inverted = "inverted",
        /// t → c·t.
        Clock = "clock",
        /// Rest in front of every record.
        Rest = "rest",
        /// Every estimation record cut in two.
        Cut = "cut",
        /// The records in another order.
        Order = "order",
        /// The records under other names.
        Names = "names",
    }
}

impl Change {
    /// The change in words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Output => "y → a·y + b",
            Self::Command => "u → α·u + β",
            Self::Inverted => "u → 1 − u",
            Self::Clock => "t → c·t",
            Self::Rest => "rest in front",
            Self::Cut => "records cut",
            Self::Order => "records reordered",
            Self::Names => "records renamed",
        }
    }

    /// Whether the samples differ, so that estimates differ by their scatter.
    pub(super) fn changes_samples(self) -> bool {
        matches!(self, Self::Rest | Self::Cut)
    }

    /// The changed records, the factor on errors, and the numbers of the change.
    pub(super) fn applied(self, base: &Base, random: &mut ChaCha8Rng) -> (Vec<Part>, f64, String) {
        let records = &base.parts;
        let mut changed = records.clone();
        let mut factor = 1.0;
        let mut words = String::new();
        match self {
            Self::Output => {
                let sign = if random.random_bool(0.25) { -1.0 } else { 1.0 };
                let a = sign * 10f64.powf(random.random_range(-2.0..2.0));
                let b = a * random.random_range(-100.0..100.0);
                each(&mut changed, |part| {
                    part.y.iter_mut().for_each(|y| *y = a * *y + b);
                });
                factor = a.abs();
                words = format!("a = {a:.4}, b = {b:.4}");
            }
            Self::Command => {
                let alpha = 10f64.powf(random.random_range(-1.0..2.5));
                let beta = alpha * random.random_range(-2.0..2.0);
                each(&mut changed, |part| {
                    part.u.iter_mut().for_each(|u| *u = alpha * *u + beta);
                });
                words = format!("α = {alpha:.4}, β = {beta:.4}");
            }
            Self::Inverted => each(&mut changed, |part| {
                part.u.iter_mut().for_each(|u| *u = 1.0 - *u);
            }),
            Self::Clock => {
                let period_s = 10f64.powf(random.random_range(-4.0..60f64.log10()));
                // Three digits, for messages.
                let period_s: f64 = format!("{period_s:.2e}").parse().unwrap_or(0.001);
                each(&mut changed, |part| part.period_s = period_s);
                words = format!("{period_s} s a sample");
            }
            Self::Rest => {
                let samples = random.random_range(10..300);
                each(&mut changed, |part| {
                    let level = part.level_at_rest();
                    let rest = (0..samples).map(|_| level + base.noise * normal(random));
                    let y: Vec<f64> = rest.chain(part.y.iter().copied()).collect();
                    let command = part.u.first().copied().unwrap_or(0.0);
                    let front = std::iter::repeat_n(command, samples);
                    part.u = front.chain(part.u.iter().copied()).collect();
                    part.y = y;
                });
                words = format!("{samples} samples");
            }
            Self::Cut => {
                changed.clear();
                for part in records {
                    let at = random.random_range(part.u.len() / 3..2 * part.u.len() / 3);
                    if part.held_out {
                        changed.push(part.clone());
                        continue;
                    }
                    words += &format!("`{}` at {at} ", part.name);
                    for (from, to) in [(0, at), (at, part.u.len())] {
                        changed.push(Part {
                            name: format!("{}-{from}", part.name),
                            u: part.u[from..to].to_vec(),
                            y: part.y[from..to].to_vec(),
                            ..part.clone()
                        });
                    }
                }
            }
            Self::Order => changed.reverse(),
            Self::Names => {
                let names = ["validate-me", "identify", "a"];
                let parts = changed.iter_mut().zip(names);
                parts.for_each(|(part, name)| part.name = name.to_owned());
            }
        }
        (changed, factor, words)
    }
}

fn each(parts: &mut [Part], change: impl FnMut(&mut Part)) {
    parts.iter_mut().for_each(change);
}

#[cfg(test)]
mod tests {
    use super::super::records::draw;
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn changes_keep_what_the_records_tell() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let base = draw(&mut random);
        let records = &base.parts;
        let total = |parts: &[Part]| parts.iter().map(|part| part.u.len()).sum::<usize>();
        for change in Change::ALL {
            let (changed, factor, _) = change.applied(&base, &mut random);
            assert!(factor > 0.0);
            assert!(changed.iter().all(|part| part.u.len() == part.y.len()));
            match change {
                Change::Rest => assert!(total(&changed) > total(records)),
                Change::Cut => assert_eq!(changed.len(), 5),
                _ => assert_eq!(changed.len(), 3),
            }
            if change != Change::Rest {
                assert_eq!(total(&changed), total(records), "{change:?}");
            }
        }
        assert_eq!(Change::of("cut"), Some(Change::Cut));
        assert_eq!(Change::of("nothing"), None);
    }
}
