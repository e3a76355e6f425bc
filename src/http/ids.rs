//! The identifiers in paths as types: what is no identifier names nothing, and is answered as such.

use std::fmt;

use axum::extract::{FromRequestParts, Path};
use axum::http::request::Parts;
use utoipa::IntoParams;
use utoipa::openapi::Required;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::schema::{ObjectBuilder, Type};
use uuid::Uuid;

use super::problem::{self, Kind, Problem};

/// What a resource is called, and the problem where there is none of an id.
trait Identified: Sized {
    const NAME: &'static str;
    const EXAMPLE: &'static str;
    const UNKNOWN: &'static Kind;

    fn read(text: &str) -> Option<Self>;

    fn parse(text: &str) -> Result<Self, Problem> {
        Self::read(text).ok_or_else(|| {
            let id = problem::shorten(text.to_owned());
            Problem::new(Self::UNKNOWN, format!("No {} has the id {id:?}.", Self::NAME))
        })
    }

    async fn from_path<S: Send + Sync>(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match Path::<String>::from_request_parts(parts, state).await {
            Ok(Path(text)) => Self::parse(&text),
            // Bytes that are no UTF-8 name nothing either.
            Err(_) => Err(Problem::new(Self::UNKNOWN, format!("No {} has such an id.", Self::NAME))),
        }
    }

    fn parameter() -> Vec<Parameter> {
        let id = ParameterBuilder::new()
            .name("id")
            .parameter_in(ParameterIn::Path)
            .required(Required::True)
            .description(Some(format!("The id of the {}", Self::NAME)))
            .schema(Some(ObjectBuilder::new().schema_type(Type::String)))
            .example(Some(Self::EXAMPLE.into()));
        vec![id.build()]
    }
}

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident($inner:ty), $what:literal, $unknown:ident, $example:literal, $read:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub struct $name(pub $inner);

        impl $name {
            /// Reads an id that stands elsewhere than in a path.
            ///
            /// # Errors
            /// The problem that there is nothing of this id, where it is none.
            #[allow(dead_code)]
            pub fn parse(text: &str) -> Result<Self, Problem> {
                Identified::parse(text)
            }
        }

        impl Identified for $name {
            const NAME: &'static str = $what;
            const EXAMPLE: &'static str = $example;
            const UNKNOWN: &'static Kind = &problem::$unknown;

            fn read(text: &str) -> Option<Self> {
                let read: fn(&str) -> Option<$inner> = $read;
                read(text).map(Self)
            }
        }

        impl<S: Send + Sync> FromRequestParts<S> for $name {
            type Rejection = Problem;

            async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
                Self::from_path(parts, state).await
            }
        }

        impl IntoParams for $name {
            fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
                Self::parameter()
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    )*};
}

ids! {
    /// The id of a mesh: 32 hexadecimal digits of the hash of its content.
    MeshId(String), "mesh", UNKNOWN_MESH, "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3", |text| {
        let digits = text.len() == 32 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        digits.then(|| text.to_owned())
    };
    /// The id of a problem: 32 hexadecimal digits of the hash of its matrices.
    ProblemId(String), "problem", UNKNOWN_PROBLEM, "7be0a1d25c9f4e3388d1c6f2904ab57e", |text| MeshId::read(text).map(|id| id.0);
    /// The id of a job.
    JobId(Uuid), "job", UNKNOWN_JOB, "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2", |text| text.parse().ok();
    /// The id of a stored field: 32 hexadecimal digits of the hash of all but its name.
    FieldId(String), "field", UNKNOWN_FIELD, "5c1f7e0a93b84d6f8e21a7b0c4d95f36", |text| MeshId::read(text).map(|id| id.0);
    /// The id of a basis.
    BasisId(Uuid), "basis", UNKNOWN_BASIS, "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", |text| text.parse().ok();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_are_ids_and_other_texts_name_nothing() {
        assert_eq!(MeshId::parse(MeshId::EXAMPLE).unwrap().to_string(), MeshId::EXAMPLE);
        assert_eq!(JobId::parse(JobId::EXAMPLE).unwrap().to_string(), JobId::EXAMPLE);
        assert_eq!(BasisId::parse(BasisId::EXAMPLE).unwrap().to_string(), BasisId::EXAMPLE);
        for wrong in ["", "none", "../../etc/passwd", &"f".repeat(31), &"F".repeat(32), &"é".repeat(16)] {
            assert_eq!(MeshId::parse(wrong).unwrap_err().kind(), &problem::UNKNOWN_MESH, "{wrong}");
        }
        for wrong in ["", "none", &"f".repeat(31), &"é".repeat(16)] {
            assert_eq!(JobId::parse(wrong).unwrap_err().kind(), &problem::UNKNOWN_JOB, "{wrong}");
        }
        let refused = BasisId::parse("seven").unwrap_err();
        assert_eq!(refused.detail(), "No basis has the id \"seven\".");
    }
}
