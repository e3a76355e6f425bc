//! The body of an ASCII PLY file.

use super::super::builder::{Builder, zero_based_index};
use super::super::text::Text;
use super::header::{Element, Header, Kind};
use super::strip::Strip;
use super::{Plan, ReadError, Role};

pub fn read(bytes: &[u8], header: &Header, plan: &Plan, builder: &mut Builder) -> Result<(), ReadError> {
    let mut body = Body { text: Text::resume(bytes, header.body, header.body_line), vertices: plan.vertices };
    for (element, role) in header.elements.iter().zip(&plan.roles) {
        // Records without properties take no room, so any number of them is nothing to read.
        if element.properties.is_empty() {
            continue;
        }
        // Every property takes at least a digit and a blank, of which the last blank may be missing.
        let possible = (body.text.remaining() as u64).div_ceil(2 * element.properties.len() as u64);
        if element.count > possible {
            let (element, declared) = (element.label(), element.count);
            return Err(ReadError::CountExceedsFile { element, declared, possible });
        }
        match role {
            Role::Vertices(_) => builder.expect_vertices(element.count, possible)?,
            Role::Faces(_) => {
                builder.expect_faces(element.count, possible, (body.text.remaining() as u64).div_ceil(8))?
            }
            Role::Strips(_) | Role::Other => {}
        }
        for number in 0..element.count as usize {
            body.record(element, *role, number, builder)?;
        }
    }
    Ok(())
}

struct Body<'a> {
    text: Text<'a>,
    vertices: usize,
}

impl Body<'_> {
    fn record(&mut self, element: &Element, role: Role, number: usize, builder: &mut Builder) -> Result<(), ReadError> {
        let truncated = || ReadError::Truncated { element: element.label(), number, declared: element.count as usize };
        let mut position = [0.0; 3];
        for (at, property) in element.properties.iter().enumerate() {
            if !self.text.any() {
                return Err(truncated());
            }
            let Kind::List { .. } = property.kind else {
                match role {
                    Role::Vertices(columns) if columns.contains(&at) => {
                        let value = self.text.float("a coordinate")?;
                        for (coordinate, &column) in position.iter_mut().zip(&columns) {
                            if column == at {
                                *coordinate = value;
                            }
                        }
                    }
                    _ => {
                        self.text.token();
                    }
                }
                continue;
            };
            let length = self.text.count("list items")?;
            let is_face = role == Role::Faces(at);
            let mut strip = (role == Role::Strips(at)).then(Strip::default);
            for _ in 0..length {
                if !self.text.any() {
                    return Err(truncated());
                }
                let location = self.text.location();
                if is_face {
                    let index = self.text.integer("a vertex index")?;
                    builder.corner(zero_based_index(index, self.vertices, "face", number, location)?, location)?;
                } else if let Some(strip) = &mut strip {
                    let index = self.text.integer("a vertex index")?;
                    strip.corner(index, self.vertices, number, location, builder)?;
                } else {
                    self.text.token();
                }
            }
            if is_face {
                builder.end_polygon();
            }
        }
        if let Role::Vertices(_) = role {
            builder.vertex(position)?;
        }
        Ok(())
    }
}
