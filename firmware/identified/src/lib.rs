//! Constants written by `host-fit codegen`, a module for each model. `on_board` is the model that the boards run,
//! and `rig` the rig to which they are connected.
//!
//! The constants in `generated/` belong to the model files in `models/`: `cargo xtask identified` regenerates them,
//! and CI checks that they agree. `cargo xtask firmware --model FILE` replaces them by the constants of that model
//! for one build.
#![no_std]
#![forbid(unsafe_code)]

include!(concat!(env!("OUT_DIR"), "/models.rs"));

#[cfg(test)]
mod tests {
    use model_core::self_test::checksum;

    macro_rules! says_what_the_host_said {
        ($($name:ident)+) => {$(
            #[test]
            fn $name() {
                use super::$name::*;
                let model = model();
                assert_eq!(checksum(&model), CHECKSUM);
                assert!(GOLDEN.holds(&model, state(&model), &REFERENCES));
            }
        )+};
    }
    each_model!(says_what_the_host_said);

    macro_rules! decides_what_the_host_decided {
        ($($name:ident: $test:ident),+) => {$(
            #[test]
            fn $test() {
                use super::$name::*;
                let model = model();
                let holds = |law, state| {
                    LAW_GOLDEN.holds::<_, _, _, LOOK_AHEAD>(law, &model, state, &REFERENCES)
                };
                assert!(holds(&LAW, state(&model)));
                let mut other = LAW;
                other.observer = f32::from_bits(LAW.observer.to_bits() + 1);
                assert!(!holds(&other, state(&model)), "a changed bit is seen");
            }
        )+};
    }
    decides_what_the_host_decided!(full: law_of_full, effects: law_of_effects, slow: law_of_slow);

    #[test]
    fn commands_have_the_unit_of_the_records() {
        use super::volts::{REFERENCES, model, share, state};
        use model_core::model::{Input, step};
        assert_eq!([2.0, 7.0, 3.25].map(share), [0.0, 1.0, 0.25]);
        assert_eq!(super::full::share(0.75), 0.75);
        let model = model();
        let last = |command: f32| {
            let mut state = state(&model);
            let input = Input {
                command: share(command),
                channels: &REFERENCES,
            };
            (0..2000).fold(0.0, |_, _| step(&model, &mut state, &input).measured)
        };
        // Without a jet the flow has no drive; b/(1 − a − c) is 1.
        assert_eq!(last(2.0), 0.0);
        assert!((last(7.0) - 1.0_f32).abs() < 1e-5, "{}", last(7.0));
    }

    #[test]
    fn pulses_come_as_designed() {
        use super::averaged::{LAW, LAW_GOLDEN};
        use model_core::control::pulses::Played;
        let (mut at, mut played, mut open) = (0, Played::new(), 0);
        for _ in 0..2 * LAW.train.period {
            let on = LAW.step(&mut played);
            assert_eq!(LAW.train.next(&mut at), on, "the valve can follow");
            open += u32::from(on);
        }
        assert_eq!((open, 2 * LAW.train.period), (2 * 237, 2 * 555));
        assert!(LAW_GOLDEN.holds_for_pulses(&LAW));
        let mut other = LAW;
        other.train.pulses[0].1 += 1;
        assert!(!LAW_GOLDEN.holds_for_pulses(&other));
    }
}
