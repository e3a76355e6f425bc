//! How a job asks to be divided: into how many parts, or as many as there are workers for.

use std::num::NonZeroUsize;

use chladni_spectral::spectrum::hsim::parts::LEAST_PAIRS;
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, Error, Visitor};

use super::value;
use crate::ParameterError;

/// The most parts of one job.
pub const MOST_PARTS: usize = 64;

/// Into how many parts a job is divided that a server spreads over its workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Parts {
    /// As many as there are workers for, of about 250 pairs or more; a job that there is one worker for stays whole.
    Word(Automatic),
    /// So many, of 64 pairs at least. A job in one part is not divided.
    Number(usize),
}

/// That the number of parts is left to the server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Automatic {
    /// The server chooses.
    Auto,
}

/// A number with bounds, or a word: more than can be said of the variants of an enum.
#[cfg(feature = "schema")]
impl utoipa::PartialSchema for Parts {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
        let word = ObjectBuilder::new().schema_type(Type::String).enum_values(Some(["auto"]));
        let word = word.description(Some("As many as there are workers for, of about 250 pairs or half a million vertices or more; where there is one worker, the job stays whole."));
        let number = ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(1)).maximum(Some(MOST_PARTS as u64));
        let number = number.description(Some("So many, of 64 pairs at least where they are of the spectrum."));
        Schema::OneOf(OneOfBuilder::new().item(word).item(number).build()).into()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for Parts {}

impl<'de> Deserialize<'de> for Parts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Reader;
        impl Visitor<'_> for Reader {
            type Value = Parts;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the word \"auto\" or a whole number")
            }
            fn visit_str<E: Error>(self, word: &str) -> Result<Parts, E> {
                if word == "auto" {
                    return Ok(Parts::Word(Automatic::Auto));
                }
                Err(E::invalid_value(serde::de::Unexpected::Str(word), &self))
            }
            fn visit_u64<E: Error>(self, number: u64) -> Result<Parts, E> {
                Ok(Parts::Number(usize::try_from(number).unwrap_or(usize::MAX)))
            }
        }
        deserializer.deserialize_any(Reader)
    }
}

impl Parts {
    /// Checks the number against its bounds, and against the pairs where their number is known. `None` where the job
    /// stays whole.
    ///
    /// # Errors
    /// [`ParameterError::Value`] says what is out of bounds.
    pub(super) fn checked(self, pairs: Option<usize>) -> Result<Option<Self>, ParameterError> {
        let Self::Number(number) = self else { return Ok(Some(self)) };
        if !(1..=MOST_PARTS).contains(&number) {
            let reason = format!("must be \"auto\" or between 1 and {MOST_PARTS}, not {number}");
            return Err(value("parts", reason));
        }
        let most = pairs.map_or(MOST_PARTS, |pairs| pairs / LEAST_PAIRS);
        if number > most.max(1) {
            let pairs = pairs.unwrap_or_default();
            let reason = format!("{pairs} pairs make at most {} parts of {LEAST_PAIRS}, not {number}", most.max(1));
            return Err(value("parts", reason));
        }
        Ok((number > 1).then_some(self))
    }

    /// The number that is asked for, where one is.
    pub(super) fn number(self) -> Option<NonZeroUsize> {
        match self {
            Self::Number(number) => NonZeroUsize::new(number),
            Self::Word(Automatic::Auto) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::JobParameters;
    use serde_json::{Value, json};

    fn read(parts: Value) -> Result<Value, String> {
        let parameters = json!({"method": "hsim", "count": 300, "parts": parts});
        let job = JobParameters::parse("eigenbasis", &parameters).map_err(|error| error.to_string())?;
        Ok(job.canonical()["parts"].clone())
    }

    #[test]
    fn parts_are_a_number_or_left_to_the_server() {
        for kept in [json!("auto"), json!(2), json!(4)] {
            assert_eq!(read(kept.clone()), Ok(kept));
        }
        for whole in [json!(1), json!(null)] {
            assert_eq!(read(whole), Ok(Value::Null));
        }
        for (wrong, words) in [
            (json!(0), "between 1 and 64, not 0"),
            (json!(65), "between 1 and 64, not 65"),
            (json!(5), "300 pairs make at most 4 parts of 64, not 5"),
            (json!(-1), "parts"),
            (json!(1.5), "parts"),
            (json!("many"), "parts"),
            (json!([2]), "parts"),
        ] {
            let error = read(wrong.clone()).unwrap_err();
            assert!(error.contains(words), "{wrong}: {error}");
        }
    }

    #[test]
    fn how_work_is_divided_makes_no_other_work() {
        let job = |parameters: Value| JobParameters::parse("eigenbasis", &parameters).unwrap();
        let whole = job(json!({"method": "hsim", "count": 300}));
        for parts in [json!("auto"), json!(3)] {
            let divided = job(json!({"method": "hsim", "count": 300, "parts": parts}));
            assert_eq!(divided.work_key("a mesh"), whole.work_key("a mesh"));
            assert_ne!(divided.canonical(), whole.canonical());
        }
    }

    #[test]
    fn what_cannot_be_divided_says_so_before_it_is_enqueued() {
        for (parameters, words) in [
            (json!({"method": "sim", "count": 300, "parts": 2}), "belongs to the method \"hsim\" and \"approximate\""),
            (json!({"method": "approximate", "certify": true, "parts": 2}), "\"certify\""),
            (json!({"method": "approximate", "refinement": "inverse_iteration", "parts": 2}), "\"refinement\""),
            (json!({"method": "approximate", "mass": "consistent", "parts": 2}), "\"mass\""),
            (json!({"method": "approximate", "operator": "robust", "parts": "auto"}), "\"operator\""),
            (json!({"method": "approximate", "operator": "volume", "parts": "auto"}), "\"operator\""),
            (json!({"variant": "published", "count": 300, "parts": 2}), "\"method\""),
            (json!({"storage": "compact", "count": 300, "parts": "auto"}), "\"storage\""),
            (json!({"operator": "graph", "count": 300, "parts": "auto"}), "\"operator\""),
        ] {
            let error = JobParameters::parse("eigenbasis", &parameters).unwrap_err().to_string();
            assert!(error.contains(words), "{parameters}: {error}");
        }
        // A member that one method alone takes chooses that method.
        let job = JobParameters::parse("eigenbasis", &json!({"count": 300, "parts": "auto"})).unwrap();
        assert_eq!(job.canonical()["method"], "hsim");
    }
}
