//! Enumerations whose values have names.

/// An enumeration with the list of its values, their names, and the value of a name.
///
/// ```
/// firmware_sim::named! {
///     /// The position of a valve.
///     pub enum Valve {
///         /// No jet.
///         Closed = "closed",
///         /// A full jet.
///         Open = "open",
///     }
/// }
///
/// assert_eq!(Valve::of("open"), Some(Valve::Open));
/// assert_eq!(Valve::ALL.map(Valve::name), ["closed", "open"]);
/// ```
#[macro_export]
macro_rules! named {
    (
        $(#[$about:meta])*
        pub enum $kind:ident { $($(#[$meaning:meta])* $value:ident = $name:literal,)+ }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $kind { $($(#[$meaning])* $value,)+ }

        impl $kind {
            /// Every value, in the order of tables.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Name for tables, keys and command lines.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$value => $name,)+ }
            }

            /// The value of that name.
            #[must_use]
            pub fn of(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}
