//! JSON with its long lists of numbers packed: what the parameters of jobs are read into before their form is checked.
//!
//! Types read it as they read JSON, with one exception: no list is read as whole numbers and others side by side.
//!
//! A number takes 8 bytes here where [`serde_json::Value`] takes 32, so 8 kB of gzip that unfold to four million zeros
//! take 32 MB and no more.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;

use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{self, Deserialize, DeserializeSeed, Deserializer, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Error, Number, Value};

/// Any JSON.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Packed {
    /// `null`.
    #[default]
    Null,
    /// A truth value.
    Bool(bool),
    /// A number.
    Number(Number),
    /// A text.
    Text(String),
    /// A list of whole numbers from 0.
    Whole(Vec<u64>),
    /// A list of numbers; NaN stands for `null`.
    Real(Vec<f64>),
    /// Any other list, and the empty one.
    List(Vec<Packed>),
    /// Members by name.
    Object(BTreeMap<String, Packed>),
}

impl Packed {
    /// A member of an object.
    pub fn get(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Object(members) => members.get(name),
            _ => None,
        }
    }

    /// A member of an object, to be changed.
    pub fn get_mut(&mut self, name: &str) -> Option<&mut Self> {
        match self {
            Self::Object(members) => members.get_mut(name),
            _ => None,
        }
    }

    /// What is found by going from member to member.
    pub fn at_mut(&mut self, path: &[&str]) -> Option<&mut Self> {
        path.iter().try_fold(self, |place, name| place.get_mut(name))
    }

    /// Whether this is `null`.
    pub fn is_null(&self) -> bool {
        *self == Self::Null
    }

    /// A list of numbers, in which NaN stands for `null`.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Whole(numbers) => Some(numbers.iter().map(|&x| x as f64).collect()),
            Self::Real(numbers) => Some(numbers.clone()),
            Self::List(list) if list.is_empty() => Some(Vec::new()),
            Self::List(list) => list.iter().map(Self::as_f64).collect(),
            _ => None,
        }
    }

    fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Null => Some(f64::NAN),
            Self::Number(number) => number.as_f64(),
            _ => None,
        }
    }

    /// A list with one more item, packed if it can be. A list that has a number which is not whole is one of reals:
    /// whoever reads whole numbers refuses it anyway.
    fn push(self, item: Self) -> Self {
        match (self, item) {
            (Self::List(list), Self::Number(number)) if list.is_empty() => match number.as_u64() {
                Some(whole) => Self::Whole(vec![whole]),
                None => Self::Real(vec![real(&number)]),
            },
            (Self::List(list), Self::Null) if list.is_empty() => Self::Real(vec![f64::NAN]),
            (Self::Whole(mut whole), Self::Number(number)) => match number.as_u64() {
                Some(x) => {
                    whole.push(x);
                    Self::Whole(whole)
                }
                None => Self::Real(whole.into_iter().map(|w| w as f64).chain([real(&number)]).collect()),
            },
            (Self::Whole(whole), Self::Null) => {
                Self::Real(whole.into_iter().map(|w| w as f64).chain([f64::NAN]).collect())
            }
            (Self::Real(mut reals), item @ (Self::Number(_) | Self::Null)) => {
                reals.push(item.as_f64().unwrap_or(f64::NAN));
                Self::Real(reals)
            }
            (list, item) => {
                let mut items = match list {
                    Self::Whole(whole) => whole.into_iter().map(|w| Self::Number(w.into())).collect(),
                    Self::Real(reals) => {
                        reals.into_iter().map(|x| Number::from_f64(x).map_or(Self::Null, Self::Number)).collect()
                    }
                    Self::List(list) => list,
                    other => vec![other],
                };
                items.push(item);
                Self::List(items)
            }
        }
    }

    /// The numbers of a packed list.
    fn packed(&self) -> usize {
        match self {
            Self::Whole(whole) => whole.len(),
            Self::Real(reals) => reals.len(),
            _ => 0,
        }
    }
}

fn real(number: &Number) -> f64 {
    number.as_f64().unwrap_or(f64::NAN)
}

impl From<&Value> for Packed {
    fn from(value: &Value) -> Self {
        match value {
            Value::Null => Self::Null,
            Value::Bool(truth) => Self::Bool(*truth),
            Value::Number(number) => Self::Number(number.clone()),
            Value::String(text) => Self::Text(text.clone()),
            Value::Array(items) => items.iter().fold(Self::List(Vec::new()), |list, item| list.push(Self::from(item))),
            Value::Object(members) => {
                Self::Object(members.iter().map(|(name, value)| (name.clone(), Self::from(value))).collect())
            }
        }
    }
}

impl From<Vec<f64>> for Packed {
    fn from(numbers: Vec<f64>) -> Self {
        Self::Real(numbers)
    }
}

/// Items and members that are read, numbers of packed lists left aside: a tree takes many times the memory of its text.
const MOST_ITEMS: usize = 10_000;

impl<'de> Deserialize<'de> for Packed {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Reader { items: &Cell::new(0) }.deserialize(deserializer)
    }
}

/// Reads any JSON and counts what it is made of.
#[derive(Clone, Copy)]
struct Reader<'c> {
    items: &'c Cell<usize>,
}

impl Reader<'_> {
    fn count<E: de::Error>(self, more: usize) -> Result<(), E> {
        self.items.set(self.items.get() + more);
        if self.items.get() > MOST_ITEMS {
            return Err(E::custom(format!("more than {MOST_ITEMS} items that are not in lists of numbers")));
        }
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = Packed;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Packed, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = Packed;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("any valid JSON value")
    }
    fn visit_unit<E>(self) -> Result<Packed, E> {
        Ok(Packed::Null)
    }
    fn visit_none<E>(self) -> Result<Packed, E> {
        Ok(Packed::Null)
    }
    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Packed, D::Error> {
        self.deserialize(deserializer)
    }
    fn visit_bool<E>(self, truth: bool) -> Result<Packed, E> {
        Ok(Packed::Bool(truth))
    }
    fn visit_u64<E>(self, number: u64) -> Result<Packed, E> {
        Ok(Packed::Number(number.into()))
    }
    fn visit_i64<E>(self, number: i64) -> Result<Packed, E> {
        Ok(Packed::Number(number.into()))
    }
    fn visit_f64<E>(self, number: f64) -> Result<Packed, E> {
        Ok(Number::from_f64(number).map_or(Packed::Null, Packed::Number))
    }
    fn visit_str<E>(self, text: &str) -> Result<Packed, E> {
        Ok(Packed::Text(text.to_owned()))
    }
    fn visit_string<E>(self, text: String) -> Result<Packed, E> {
        Ok(Packed::Text(text))
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Packed, A::Error> {
        let mut list = Packed::List(Vec::new());
        while let Some(item) = items.next_element_seed(self)? {
            let packs = match &list {
                Packed::List(items) => items.is_empty(),
                _ => true,
            };
            if !(packs && matches!(item, Packed::Number(_) | Packed::Null)) {
                self.count(1 + list.packed())?;
            }
            list = list.push(item);
        }
        Ok(list)
    }
    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Packed, A::Error> {
        let mut object = BTreeMap::new();
        while let Some(name) = members.next_key::<String>()? {
            self.count(1)?;
            if object.contains_key(&name) {
                return Err(de::Error::custom(format!("duplicate field `{name}`")));
            }
            object.insert(name, members.next_value_seed(self)?);
        }
        Ok(Packed::Object(object))
    }
}

impl<'de> IntoDeserializer<'de, Error> for &'de Packed {
    type Deserializer = Self;
    fn into_deserializer(self) -> Self {
        self
    }
}

/// A number of a packed list.
enum Scalar {
    Whole(u64),
    Real(f64),
}

impl<'de> IntoDeserializer<'de, Error> for Scalar {
    type Deserializer = Self;
    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Scalar {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Self::Whole(number) => visitor.visit_u64(number),
            Self::Real(number) if number.is_nan() => visitor.visit_unit(),
            Self::Real(number) => visitor.visit_f64(number),
        }
    }
    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Self::Real(number) if number.is_nan() => visitor.visit_none(),
            other => visitor.visit_some(other),
        }
    }
    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct newtype_struct seq tuple
        tuple_struct map struct enum identifier ignored_any
    }
}

impl<'de> Deserializer<'de> for &'de Packed {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Packed::Null => visitor.visit_unit(),
            Packed::Bool(truth) => visitor.visit_bool(*truth),
            Packed::Number(number) => number.deserialize_any(visitor),
            Packed::Text(text) => visitor.visit_borrowed_str(text),
            Packed::Whole(whole) => whole_list(SeqDeserializer::new(whole.iter().map(|&x| Scalar::Whole(x))), visitor),
            Packed::Real(real) => whole_list(SeqDeserializer::new(real.iter().map(|&x| Scalar::Real(x))), visitor),
            Packed::List(list) => whole_list(SeqDeserializer::new(list.iter()), visitor),
            Packed::Object(members) => {
                let mut map = MapDeserializer::new(members.iter().map(|(name, value)| (name.as_str(), value)));
                let made = visitor.visit_map(&mut map)?;
                map.end()?;
                Ok(made)
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        if self.is_null() { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    /// Members by name: a list would be taken by position, and one in another order for something else.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self {
            Packed::Whole(_) | Packed::Real(_) | Packed::List(_) => {
                Err(de::Error::invalid_type(de::Unexpected::Seq, &visitor))
            }
            other => other.deserialize_any(visitor),
        }
    }

    /// A word, or an object of one member.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self {
            Packed::Text(word) => visitor.visit_enum(IntoDeserializer::<Error>::into_deserializer(word.as_str())),
            Packed::Object(members) if members.len() == 1 => {
                let map = MapDeserializer::new(members.iter().map(|(name, value)| (name.as_str(), value)));
                visitor.visit_enum(de::value::MapAccessDeserializer::new(map))
            }
            // It says the same as the parser of values does.
            other => other.to_value().deserialize_enum(name, variants, visitor),
        }
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq tuple tuple_struct map
        identifier ignored_any
    }
}

/// Gives a visitor a list, of which nothing may be left.
fn whole_list<'de, I, V>(mut list: SeqDeserializer<I, Error>, visitor: V) -> Result<V::Value, Error>
where
    I: Iterator,
    I::Item: IntoDeserializer<'de, Error>,
    V: Visitor<'de>,
{
    let made = visitor.visit_seq(&mut list)?;
    list.end()?;
    Ok(made)
}

impl Packed {
    /// The same as a value; lists longer than a message tells are cut.
    fn to_value(&self) -> Value {
        match self {
            Self::Null => Value::Null,
            Self::Bool(truth) => Value::Bool(*truth),
            Self::Number(number) => Value::Number(number.clone()),
            Self::Text(text) => Value::String(text.clone()),
            Self::Whole(_) | Self::Real(_) | Self::List(_) => Value::Array(Vec::new()),
            Self::Object(members) => Value::Object(members.keys().map(|name| (name.clone(), Value::Null)).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn packed(text: &str) -> Packed {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn lists_are_packed_where_they_can_be() {
        assert_eq!(packed("[1, 2]"), Packed::Whole(vec![1, 2]));
        assert_eq!(packed("[1, 2.5, -3]"), Packed::Real(vec![1.0, 2.5, -3.0]));
        assert_eq!(packed("[18446744073709551615, 0]"), Packed::Whole(vec![u64::MAX, 0]));
        assert!(matches!(packed("[]"), Packed::List(_)));
        assert!(matches!(packed("[1, \"a\"]"), Packed::List(_)));
        let Packed::Real(nulls) = packed("[1, null]") else { panic!("not packed") };
        assert!(nulls[0] == 1.0 && nulls[1].is_nan());
        assert!(std::mem::size_of::<Packed>() <= 32);
    }

    #[test]
    fn texts_that_unfold_into_large_trees_are_refused() {
        let read = |text: String| serde_json::from_str::<Packed>(&text).map_err(|error| error.to_string());
        for item in ["[]", "{}", "\"\"", "true", "[[0]]", "{\"a\": 0}"] {
            let refused = read(format!("[{}0]", format!("{item},").repeat(20_000))).unwrap_err();
            assert!(refused.contains("more than 10000 items"), "{item}: {refused}");
            read(format!("[{}0]", format!("{item},").repeat(2_000))).unwrap();
        }
        // A list of numbers that is none after all.
        assert!(read(format!("[{}\"\"]", "0,".repeat(20_000))).is_err());
        assert_eq!(read(format!("[{}0]", "0,".repeat(20_000))), Ok(Packed::Whole(vec![0; 20_001])));
        assert!(
            read(format!("{{{}\"z\":0}}", (0..20_000).map(|k| format!("\"{k}\":0,")).collect::<String>())).is_err()
        );
    }

    /// What a type reads is the same from a value, from a text and packed; so is what it refuses.
    fn agree<T: de::DeserializeOwned + PartialEq + fmt::Debug>(text: &str) {
        let value: Value = serde_json::from_str(text).unwrap();
        let expected = T::deserialize(&value).map_err(|_| ());
        assert_eq!(T::deserialize(&packed(text)).map_err(|_| ()), expected, "{text}");
        assert_eq!(T::deserialize(&Packed::from(&value)).map_err(|_| ()), expected, "{text}");
    }

    #[test]
    fn types_read_it_as_they_read_json() {
        let texts = [
            "null",
            "true",
            "3",
            "-3",
            "3.5",
            "1e400",
            "\"a\"",
            "[]",
            "[1,2,3]",
            "[1,2.5]",
            "[0.5,2]",
            "[1,null]",
            "[null,null]",
            "[[1],[2,0.5]]",
            "{}",
            "{\"a\": 1}",
            "{\"a\": [1,2]}",
            "{\"a\": {\"b\": null}}",
            "{\"heat\": {}}",
            "\"heat\"",
            "[1,\"x\"]",
            "[18446744073709551615,0.5]",
        ];
        for text in texts.into_iter().filter(|text| serde_json::from_str::<Value>(text).is_ok()) {
            agree::<Vec<u32>>(text);
            agree::<Vec<f64>>(text);
            agree::<Vec<Option<f64>>>(text);
            agree::<[f64; 2]>(text);
            agree::<Option<u8>>(text);
            agree::<f64>(text);
            agree::<String>(text);
            agree::<BTreeMap<String, Vec<u64>>>(text);
            agree::<Vec<Vec<f64>>>(text);
            // A list for the members of a struct is the exception: whole numbers and others side by side.
            if !text.starts_with('[') {
                agree::<crate::VibrationBasisParameters>(text);
            }
            agree::<crate::VibrationMethodName>(text);
        }
    }

    #[test]
    fn a_refusal_names_the_place_and_not_the_whole_list() {
        let long = json!({"clamped": vec![0.5; 1000]});
        let refused = crate::JobParameters::parse("vibration_basis", &long).unwrap_err().to_string();
        assert!(refused.contains("clamped[0]") && refused.len() < 300, "{refused}");
    }
}
