//! Cancellation is no failure: where one error becomes another, it stays what it is.

/// Lets `?` turn errors that know [`Cancelled`](crate::Cancelled) into one that knows it as well: their `Cancelled`
/// becomes its own, and all else what stands behind the arrow, a variant or a closure.
///
/// ```
/// # #[derive(Debug, PartialEq)] enum Inner { Cancelled(chladni_base::Cancelled), Singular }
/// # #[derive(Debug, PartialEq)] enum Outer { Cancelled(chladni_base::Cancelled), Inner(Inner) }
/// chladni_base::stopped!(Outer: Inner => Self::Inner);
/// assert_eq!(Outer::from(Inner::Cancelled(chladni_base::Cancelled)), Outer::Cancelled(chladni_base::Cancelled));
/// assert_eq!(Outer::from(Inner::Singular), Outer::Inner(Inner::Singular));
/// ```
#[macro_export]
macro_rules! stopped {
    ($into:ident: $($error:ident => $otherwise:expr),+ $(,)?) => {$(
        impl From<$error> for $into {
            fn from(error: $error) -> Self {
                match error {
                    $error::Cancelled(cancelled) => Self::Cancelled(cancelled),
                    other => $otherwise(other),
                }
            }
        }
    )+};
}
