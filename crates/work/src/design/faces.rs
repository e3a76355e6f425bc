//! The faces that an answer is about: a sample of so many, or a list.

use serde::{Deserialize, Serialize};

use super::DesignFault;
use super::fault::{refused, refused_at};

/// Faces that an answer is about.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum FacesRequest {
    /// So many, spread evenly.
    Sample(FaceSample),
    /// These, in this order; at most 100,000.
    List(Vec<u32>),
}

/// Faces that are spread evenly over a surface, the same in every request: each as far as possible from those before
/// it, so that the first of many are the sample of few.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct FaceSample {
    /// How many; all faces where there are fewer.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 100_000))]
    pub sample: usize,
}

/// The most faces of a sample, or of a list.
pub const MOST_SAMPLED: usize = 100_000;

impl FacesRequest {
    /// Checks how many are wanted.
    ///
    /// # Errors
    /// [`DesignFault::Request`] says how many there may be.
    pub fn check_count(&self) -> Result<(), DesignFault> {
        match self {
            Self::Sample(FaceSample { sample }) if !(1..=MOST_SAMPLED).contains(sample) => {
                let reason = format!("must be from 1 to {MOST_SAMPLED}, not {sample}");
                Err(refused("faces", "faces.sample", reason))
            }
            Self::List(faces) if faces.len() > MOST_SAMPLED => {
                let reason = format!("must be at most {MOST_SAMPLED} faces, not {}", faces.len());
                Err(refused("faces", "faces", reason))
            }
            _ => Ok(()),
        }
    }

    /// Checks a list against the number of faces.
    ///
    /// # Errors
    /// [`DesignFault::Request`] names a face that is not there.
    pub fn check_faces(&self, faces: usize) -> Result<(), DesignFault> {
        let Self::List(list) = self else { return Ok(()) };
        match list.iter().position(|&face| face as usize >= faces) {
            Some(at) => {
                let reason = format!("refers to face {} of {faces}", list[at]);
                Err(refused_at(list[at], "faces", &format!("faces[{at}]"), reason))
            }
            None => Ok(()),
        }
    }
}

impl<'de> Deserialize<'de> for FacesRequest {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = FacesRequest;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object {\"sample\": n} or an array of faces")
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                Deserialize::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map(FacesRequest::Sample)
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                Deserialize::deserialize(serde::de::value::SeqAccessDeserializer::new(list)).map(FacesRequest::List)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}
