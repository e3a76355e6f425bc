//! `{"vertices": [[x, y, z], …], "faces": [[a, b, c], …], "tetrahedra": [[a, b, c, d], …]}`, straight into the mesh.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::super::builder::Builder;
use super::super::error::{FileLocation, ReadError};
use super::super::{MeshFormat, RawMesh, ReadLimits};
use super::{finish, wrong};

/// Reads arrays. Faces may have any number of corners; further members are passed over.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let mut reader = Reader { builder: Builder::new(limits), refused: None, seen: Vec::new() };
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let read = RootSeed(&mut reader).deserialize(&mut json).and_then(|()| json.end());
    match (reader.refused, read) {
        (Some(refused), _) => Err(refused),
        (None, Err(error)) => Err(wrong(MeshFormat::Json, message(&error))),
        (None, Ok(())) => finish(reader.builder, MeshFormat::Json),
    }
}

/// What is wrong, without the whole of a long text that stands where it should not.
fn message(error: &serde_json::Error) -> String {
    const LONGEST: usize = 160;
    let whole = error.to_string();
    if whole.chars().count() <= LONGEST {
        return whole;
    }
    let start: String = whole.chars().take(LONGEST).collect();
    format!("{start}… at line {} column {}", error.line(), error.column())
}

struct Reader<'l> {
    builder: Builder<'l>,
    /// A limit that was met, which serde can only tell as a text.
    refused: Option<ReadError>,
    seen: Vec<&'static str>,
}

impl Reader<'_> {
    fn take<E: Error>(&mut self, result: Result<(), ReadError>) -> Result<(), E> {
        result.map_err(|refused| {
            let told = E::custom(&refused);
            self.refused = Some(refused);
            told
        })
    }
}

/// The object.
struct RootSeed<'r, 'l>(&'r mut Reader<'l>);

/// One of its lists.
struct List<'r, 'l>(&'r mut Reader<'l>, &'static str);

/// One entry of a list.
struct Entry<'r, 'l>(&'r mut Reader<'l>, &'static str);

impl<'de> DeserializeSeed<'de> for RootSeed<'_, '_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for RootSeed<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with the members vertices and faces")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(name) = map.next_key::<String>()? {
            let known = ["vertices", "faces", "tetrahedra"].into_iter().find(|known| *known == name);
            let Some(name) = known else {
                map.next_value::<IgnoredAny>()?;
                continue;
            };
            if self.0.seen.contains(&name) {
                return Err(A::Error::custom(format!("a second member `{name}`")));
            }
            self.0.seen.push(name);
            map.next_value_seed(List(self.0, name))?;
        }
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for List<'_, '_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for List<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {}", self.1)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(Entry(self.0, self.1))?.is_some() {}
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for Entry<'_, '_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Entry<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.1 {
            "vertices" => "three coordinates of a vertex",
            "faces" => "the vertices of a face",
            _ => "the four vertices of a tetrahedron",
        })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Self(reader, name) = self;
        match name {
            "vertices" => {
                let position = exactly::<f64, 3, A>(&mut list, "three coordinates")?;
                let taken = reader.builder.vertex(position);
                reader.take(taken)
            }
            "faces" => {
                while let Some(corner) = list.next_element::<u32>()? {
                    let taken = reader.builder.corner(corner, FileLocation::Byte(0));
                    reader.take(taken)?;
                }
                reader.builder.end_polygon();
                Ok(())
            }
            _ => {
                let corners = exactly::<u32, 4, A>(&mut list, "four vertices")?;
                let taken = reader.builder.tetrahedron(corners);
                reader.take(taken)
            }
        }
    }
}

fn exactly<'de, T, const N: usize, A>(list: &mut A, expected: &'static str) -> Result<[T; N], A::Error>
where
    T: serde::Deserialize<'de> + Copy + Default,
    A: SeqAccess<'de>,
{
    let mut values = [T::default(); N];
    for (at, value) in values.iter_mut().enumerate() {
        *value = list.next_element()?.ok_or_else(|| A::Error::invalid_length(at, &expected))?;
    }
    match list.next_element::<IgnoredAny>()? {
        None => Ok(values),
        Some(_) => Err(A::Error::invalid_length(N + 1, &expected)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<RawMesh, ReadError> {
        super::read(text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn members_come_in_any_order_and_polygons_are_faces() {
        let mesh = read(
            r#"{"faces": [[0, 1, 2, 3], [0, 1], [3, 2, 4]], "name": {"a": [1]}, "vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1.5]]}"#,
        )
        .unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
        assert_eq!((mesh.polygons.unwrap().of_triangle, mesh.short_faces_dropped), (vec![0, 0, 2], 1));
        assert_eq!(mesh.positions[4], [0.0, 0.0, 1.5]);
        let solid = read(r#"{"vertices": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]], "tetrahedra": [[0,1,2,3]]}"#).unwrap();
        assert_eq!(solid.tetrahedra, [[0, 1, 2, 3]]);
    }

    #[test]
    fn refusals_say_where() {
        for (text, expected) in [
            ("[1]", "expected an object with the members vertices and faces"),
            (r#"{"vertices": [[0, 0]]}"#, "three coordinates"),
            (r#"{"vertices": [[0, 0, 0, 0]]}"#, "three coordinates"),
            (r#"{"vertices": [[0, 0, "x"]]}"#, "line 1 column 24"),
            (r#"{"vertices": [[0, 0, 0]], "faces": [[0, 1, 0]]}"#, "triangle 0 refers to vertex 1; there are 1"),
            (r#"{"vertices": [[0, 0, 0]], "faces": [[0, -1, 0]]}"#, "-1"),
            (r#"{"vertices": [[0, 0, 0]], "tetrahedra": [[0, 0, 0, 7]]}"#, "tetrahedron 0 refers to vertex 7"),
            (r#"{"vertices": [], "vertices": []}"#, "second member"),
            (r#"{"vertices": [[0, 0, 0]]} x"#, "trailing"),
            (r#"{"vertices": [[0, 0, 0]"#, "EOF"),
        ] {
            let refused = read(text).unwrap_err().to_string();
            assert!(refused.contains(expected), "{text}: {refused}");
        }
        let long = read(&format!("{:?}", "a".repeat(5000))).unwrap_err().to_string();
        assert!(long.len() < 300 && long.contains("line 1"), "{long}");
        let few = ReadLimits { vertices: 1, ..ReadLimits::default() };
        let refused = super::read(br#"{"vertices": [[0,0,0],[1,0,0]]}"#, &few);
        assert_eq!(refused, Err(ReadError::TooManyVertices { limit: 1 }));
    }
}
