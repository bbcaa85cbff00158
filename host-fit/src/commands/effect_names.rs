//! Names of effects as arguments. A shell completes those of the catalogue; other names may be effects of the
//! user's own.

use std::ffi::OsStr;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use host_fit::steps::catalogue;

/// Takes any name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EffectName;

impl TypedValueParser for EffectName {
    type Value = String;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let names = catalogue().into_iter().map(|effect| effect.name);
        Some(Box::new(names.map(PossibleValue::new)))
    }
}
