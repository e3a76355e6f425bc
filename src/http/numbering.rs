//! In which numbering a request names vertices and faces, and gives and takes functions: that of the file, unless it
//! says otherwise.

use axum::extract::{FromRequestParts, Query};
use axum::http::Uri;
use axum::http::request::Parts;
use axum::http::uri::PathAndQuery;
use chladni_mesh::numbering::{Extension, NumberingError, Translation};
use chladni_spectral::basis::Provenance;
use chladni_work::numbered::FunctionError;
use futures_util::future::BoxFuture;
use serde::{Deserialize, Serialize};
use utoipa::IntoParams;
use uuid::Uuid;

use super::client::ClientState;
use super::convert::sentence;
use super::extract;
use super::problem::{self, Problem};

/// A numbering of vertices and faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum NumberingName {
    /// That of the uploaded file: vertices as its lines or entries, polygons as one face, three vertices for each facet
    /// of an STL.
    #[default]
    File,
    /// That of the mesh that was made of it: what `GET /v1/meshes/{id}/content` gives.
    Kept,
}

/// What a function is at vertices of the file that were dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExtensionName {
    /// Not a number: null in JSON.
    #[default]
    None,
    /// What the nearest vertex has that was kept.
    Nearest,
}

/// How a request numbers vertices and faces.
#[derive(Debug, Clone, Copy, Default, Deserialize, IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct NumberingQuery {
    /// How vertices and faces are numbered, in the request and in the answer: as in the uploaded file, or as in the
    /// mesh that was kept of it (`GET /v1/meshes/{id}/vertex-map`). Values at merged vertices have to agree; those at
    /// dropped ones are ignored, and answered as null.
    #[param(inline, default = "file")]
    pub numbering: NumberingName,
    /// What vertices of the file are given that were dropped: null, or what the nearest vertex has; by the second,
    /// naming such a vertex means the nearest.
    #[param(inline, default = "none")]
    pub extend: ExtensionName,
}

/// The numbering of a request. Comes before the other parameters of the query, and takes its own out of it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Numbered(pub NumberingQuery);

impl<S: Send + Sync> FromRequestParts<S> for Numbered {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        Self::taken_from(parts)
    }
}

impl Numbered {
    /// Takes what is about the numbering out of the query.
    fn taken_from(parts: &mut Parts) -> Result<Self, Problem> {
        let Some(query) = parts.uri.query() else { return Ok(Self::default()) };
        let own = |pair: &&str| matches!(pair.split('=').next(), Some("numbering" | "extend"));
        let (mine, others): (Vec<&str>, Vec<&str>) = query.split('&').partition(own);
        if mine.is_empty() {
            return Ok(Self::default());
        }
        let own = Uri::try_from(format!("/?{}", mine.join("&"))).map_err(Problem::internal)?;
        let found = Query::<NumberingQuery>::try_from_uri(&own);
        let Query(found) = found.map_err(|error| extract::invalid_query(&error.body_text(), &mine.join("&")))?;
        let rest = match others.is_empty() {
            true => parts.uri.path().to_owned(),
            false => format!("{}?{}", parts.uri.path(), others.join("&")),
        };
        let mut uri = std::mem::take(&mut parts.uri).into_parts();
        uri.path_and_query = Some(PathAndQuery::try_from(rest).map_err(Problem::internal)?);
        parts.uri = Uri::from_parts(uri).map_err(Problem::internal)?;
        Ok(Self(found))
    }

    /// How vertices and faces of a mesh are translated.
    ///
    /// # Errors
    /// Those of loading a mesh.
    pub fn on_mesh<'a>(self, state: &'a ClientState, mesh: &'a str) -> BoxFuture<'a, Result<Translation, Problem>> {
        Box::pin(async move {
            let extend = match self.0.extend {
                ExtensionName::None => Extension::None,
                ExtensionName::Nearest => Extension::Nearest,
            };
            Ok(match self.0.numbering {
                NumberingName::Kept => Translation::default(),
                NumberingName::File => Translation::of_file(state.store.load_numbering(mesh).await?, extend),
            })
        })
    }

    /// The same for numbers in the frames of faces, which faces that the check turned over have others of than in the
    /// file.
    ///
    /// # Errors
    /// Those of loading a mesh.
    pub async fn on_frames(self, state: &ClientState, mesh: &str) -> Result<Translation, Problem> {
        let to = self.on_mesh(state, mesh).await?;
        Ok(to.turning(state.store.mesh(mesh).await?.turned_faces()))
    }

    /// The same of the mesh that a product lives on: its metadata name the mesh, else its record does.
    ///
    /// # Errors
    /// Those of loading a mesh.
    pub async fn on_basis(self, state: &ClientState, id: Uuid, made: &Provenance) -> Result<Translation, Problem> {
        match (self.0.numbering, made.mesh()) {
            (NumberingName::Kept, _) => Ok(Translation::default()),
            (_, Some(mesh)) => self.on_mesh(state, mesh).await,
            (_, None) => self.on_mesh(state, &state.store.basis(id).await?.mesh).await,
        }
    }

    /// What tells answers apart that are the same but for the numbering.
    pub fn tag(self) -> String {
        match self.0.numbering {
            NumberingName::Kept => "-kept".to_owned(),
            NumberingName::File => format!("-file-{:?}", self.0.extend),
        }
    }
}

impl From<NumberingError> for Problem {
    fn from(error: NumberingError) -> Self {
        let text = sentence(&error);
        match error {
            NumberingError::NoVertex { vertex, vertices } => {
                Self::new(&problem::INVALID_VERTEX, text).with("vertex", vertex).with("vertices", vertices)
            }
            NumberingError::DroppedVertex { vertex } | NumberingError::InnerVertex { vertex } => {
                Self::new(&problem::INVALID_VERTEX, text).with("vertex", vertex)
            }
            NumberingError::NoFace { face, .. } | NumberingError::DroppedFace { face } => {
                Self::within(&problem::INVALID_DESIGN, "face", text).with("face", face)
            }
            NumberingError::Length { .. }
            | NumberingError::NotFinite { .. }
            | NumberingError::Disagreement { .. }
            | NumberingError::Frames
            | NumberingError::Turned { .. } => Self::new(&problem::INVALID_FUNCTION, text),
        }
    }
}

impl From<FunctionError> for Problem {
    fn from(error: FunctionError) -> Self {
        match error {
            FunctionError::Table(error) => error.into(),
            FunctionError::Numbering(error) => error.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::Request;

    async fn numbered(uri: &str) -> Result<(Numbered, String), Problem> {
        let mut parts = Request::builder().uri(uri).body(()).unwrap().into_parts().0;
        let found = Numbered::from_request_parts(&mut parts, &()).await?;
        Ok((found, parts.uri.to_string()))
    }

    #[tokio::test]
    async fn it_takes_its_own_parameters_out_of_the_query() {
        let (found, rest) = numbered("/v1/a?dtype=f64&numbering=kept&request=%7B%7D&extend=nearest").await.unwrap();
        assert_eq!((found.0.numbering, found.0.extend), (NumberingName::Kept, ExtensionName::Nearest));
        assert_eq!(rest, "/v1/a?dtype=f64&request=%7B%7D");
        assert_eq!(numbered("http://host/v1/a?numbering=file").await.unwrap().1, "http://host/v1/a");
        assert_eq!(numbered("/v1/a?x=numbering").await.unwrap().1, "/v1/a?x=numbering");
        for wrong in ["/a?numbering=mine", "/a?extend", "/a?numbering=file&numbering=kept"] {
            assert_eq!(numbered(wrong).await.unwrap_err().kind(), &problem::INVALID_QUERY, "{wrong}");
        }
    }
}
