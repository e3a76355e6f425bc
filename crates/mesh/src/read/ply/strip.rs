//! Triangle strips.

use super::super::builder::{Builder, zero_based_index};
use super::{FileLocation, ReadError};

/// Follows strips: each corner after the second makes a triangle with the two before it, and every other triangle is
/// turned round. A negative index begins a new strip.
#[derive(Default)]
pub struct Strip {
    older: u32,
    newer: u32,
    length: usize,
}

impl Strip {
    /// Adds a corner or a restart. Triangles that repeat a corner only stitch strips together, so they are left out.
    pub fn corner(
        &mut self,
        index: i64,
        vertices: usize,
        number: usize,
        location: FileLocation,
        builder: &mut Builder,
    ) -> Result<(), ReadError> {
        // An unsigned list writes −1 as its largest value.
        if index == -1 || index == i64::from(u32::MAX) {
            self.length = 0;
            return Ok(());
        }
        let vertex = zero_based_index(index, vertices, "strip", number, location)?;
        if self.length >= 2 && self.older != self.newer && self.older != vertex && self.newer != vertex {
            let turned = self.length % 2 == 1;
            builder.triangle(if turned {
                [self.newer, self.older, vertex]
            } else {
                [self.older, self.newer, vertex]
            })?;
        }
        self.older = self.newer;
        self.newer = vertex;
        self.length += 1;
        Ok(())
    }
}
