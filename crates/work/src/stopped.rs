//! Cancellation is no failure: where an error of the numerics becomes one of ours, it stays what it is.

/// Turns errors of the numerics into variants of `$into`, and their `Cancelled` into its own.
macro_rules! stopped {
    ($into:ident: $($error:ident => $variant:ident),+ $(,)?) => {$(
        impl From<$error> for $into {
            fn from(error: $error) -> Self {
                match error {
                    $error::Cancelled(cancelled) => Self::Cancelled(cancelled),
                    other => Self::$variant(other),
                }
            }
        }
    )+};
}
