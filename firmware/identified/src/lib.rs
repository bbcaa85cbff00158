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
}
