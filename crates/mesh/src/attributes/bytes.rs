//! Attributes as bytes, to be stored behind the mesh that they belong to.

use super::{Attributes, Labels, Layer, NONE};

impl Attributes {
    /// The attributes as bytes, little-endian: both layers, then the names; every list begins with its length as u64.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.bytes() as usize + 128);
        layer(&mut out, self.texture.as_ref());
        layer(&mut out, self.normals.as_ref());
        for labels in self.labels() {
            texts(&mut out, &labels.names);
            count(&mut out, labels.runs.len());
            out.extend(labels.runs.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        }
        texts(&mut out, &self.libraries);
        out
    }

    /// Reads what [`to_bytes`](Self::to_bytes) made for a mesh of so many faces; `None` where it does not fit.
    pub fn from_bytes(bytes: &[u8], faces: usize) -> Option<Self> {
        let mut from = Reader(bytes);
        let (texture, normals) = (from.layer(faces)?, from.layer(faces)?);
        let (groups, objects, materials) = (from.labels(faces)?, from.labels(faces)?, from.labels(faces)?);
        let libraries = from.texts()?;
        from.0.is_empty().then_some(Self { texture, normals, groups, objects, materials, libraries })
    }
}

fn count(out: &mut Vec<u8>, count: usize) {
    out.extend((count as u64).to_le_bytes());
}

fn layer<const N: usize>(out: &mut Vec<u8>, layer: Option<&Layer<N>>) {
    let (values, corners) = layer.map_or((&[][..], &[][..]), |layer| (&layer.values, &layer.corners));
    count(out, values.len());
    out.extend(values.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    if !values.is_empty() {
        out.extend(corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    }
}

fn texts(out: &mut Vec<u8>, texts: &[Vec<u8>]) {
    count(out, texts.len());
    for text in texts {
        count(out, text.len());
        out.extend_from_slice(text);
    }
}

struct Reader<'b>(&'b [u8]);

impl Reader<'_> {
    fn take(&mut self, bytes: usize) -> Option<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        Some(taken)
    }

    /// A length; no list has more entries than bytes are left.
    fn count(&mut self) -> Option<usize> {
        let word = self.take(8)?.first_chunk().copied()?;
        usize::try_from(u64::from_le_bytes(word)).ok().filter(|&count| count <= self.0.len())
    }

    fn indices(&mut self, count: usize) -> Option<Vec<u32>> {
        let bytes = self.take(count.checked_mul(4)?)?;
        Some(bytes.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word)).collect())
    }

    fn layer<const N: usize>(&mut self, faces: usize) -> Option<Option<Layer<N>>> {
        let count = self.count()?;
        if count == 0 {
            return Some(None);
        }
        let numbers = self.take(count.checked_mul(8 * N)?)?.as_chunks::<8>().0;
        let numbers: Vec<f64> = numbers.iter().map(|&word| f64::from_le_bytes(word)).collect();
        let corners = self.indices(faces.checked_mul(3)?)?;
        let fits = corners.iter().all(|&index| index == NONE || (index as usize) < count);
        let layer = Layer { values: numbers.as_chunks().0.to_vec(), corners: corners.as_chunks().0.to_vec() };
        fits.then_some(Some(layer))
    }

    fn texts(&mut self) -> Option<Vec<Vec<u8>>> {
        let count = self.count()?;
        let text = |_| {
            let length = self.count()?;
            self.take(length).map(<[u8]>::to_vec)
        };
        (0..count).map(text).collect()
    }

    fn labels(&mut self, faces: usize) -> Option<Labels> {
        let names = self.texts()?;
        let count = self.count()?;
        let runs = self.indices(count.checked_mul(2)?)?.as_chunks().0.to_vec();
        let fits =
            |&[face, name]: &[u32; 2]| (face as usize) < faces && (name == NONE || (name as usize) < names.len());
        let ascends = runs.windows(2).all(|pair| pair[0][0] < pair[1][0]);
        (ascends && runs.iter().all(fits)).then_some(Labels { names, runs })
    }
}
