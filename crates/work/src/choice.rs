//! Members that are a known word or numbers. Serde's untagged enums would first hold the numbers as a tree of values,
//! which takes many times their memory, and could not say what is wrong with them; here the first token decides.

/// Reads an enum that is either a word (`Word(W)`) or, by its first token, an object, an array, or either.
#[macro_export]
macro_rules! word_or {
    ($name:ident, $expecting:literal, $word:ident($words:ty), object $other:ident) => {
        $crate::word_or!(@impl $name, $expecting, $word($words),
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                serde::Deserialize::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map($name::$other)
            });
    };
    ($name:ident, $expecting:literal, $word:ident($words:ty), array $other:ident) => {
        $crate::word_or!(@impl $name, $expecting, $word($words),
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                serde::Deserialize::deserialize(serde::de::value::SeqAccessDeserializer::new(list)).map($name::$other)
            });
    };
    ($name:ident, $expecting:literal, $word:ident($words:ty), array $other:ident, object $third:ident) => {
        $crate::word_or!(@impl $name, $expecting, $word($words),
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
                serde::Deserialize::deserialize(serde::de::value::SeqAccessDeserializer::new(list)).map($name::$other)
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                serde::Deserialize::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map($name::$third)
            });
    };
    (@impl $name:ident, $expecting:literal, $word:ident($words:ty), $($visit:item)*) => {
        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Visitor;
                impl<'de> serde::de::Visitor<'de> for Visitor {
                    type Value = $name;

                    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                        f.write_str($expecting)
                    }

                    fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Self::Value, E> {
                        use serde::de::IntoDeserializer;
                        let known: Result<$words, E> = serde::Deserialize::deserialize(word.into_deserializer());
                        known.map($name::$word)
                    }

                    $($visit)*
                }
                deserializer.deserialize_any(Visitor)
            }
        }
    };
}
