//! Constants that `host-fit codegen` wrote from the model files in `models/`;
//! `cargo xtask identified` writes them anew, and CI compares.
#![no_std]
#![forbid(unsafe_code)]

pub mod averaged;
pub mod effects;
pub mod full;
pub mod own;

/// The model that the boards run: replace it with your own generated file.
pub use full as on_board;

#[cfg(test)]
mod tests {
    use model_core::self_test::checksum;

    macro_rules! says_what_the_host_said {
        ($($name:ident),+) => {$(
            #[test]
            fn $name() {
                use super::$name::*;
                let model = model();
                assert_eq!(checksum(&model), CHECKSUM);
                assert!(GOLDEN.holds(&model, state(&model), &REFERENCES));
            }
        )+};
    }
    says_what_the_host_said!(full, averaged, effects, own);

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
    decides_what_the_host_decided!(full: law_of_full, effects: law_of_effects);

    #[test]
    fn pulses_come_as_designed() {
        use super::averaged::{HOLD, LAW};
        use model_core::control::Hold;
        let (mut at, mut hold) = (0, Hold::closed());
        let valve = (0..2 * LAW.period).map(|_| {
            let wanted = LAW.next(&mut at);
            (wanted, hold.pass(&HOLD, wanted))
        });
        let mut open = 0;
        for (wanted, on) in valve {
            assert_eq!(wanted, on, "the valve can follow");
            open += u32::from(on);
        }
        assert_eq!((open, 2 * LAW.period), (2 * 237, 2 * 555));
    }
}
