//! A part of an eigenproblem as an NPZ file: of each slice `values_K` and `vectors_K` (`n × k`, rows first, in the
//! order of the unknowns), and the JSON text `part`: the plan, the number of the part, where slices begin, their
//! counts, or why they were given up; and whatever its maker wants to know when the parts are joined. Of an
//! approximation there are no slices, but `rows`, the subspace on them (`data`, `indices`, `indptr`), `values`,
//! `coefficients` and `sums`.

use std::io::{Cursor, Read, Seek, Write};

use chladni_algebra::{DenseMatrix, PANEL_WIDTH, PanelMatrix};
use chladni_mesh::npy::NpyHeader;
use serde::{Deserialize, Serialize};
use zip::{ZipArchive, ZipWriter};

use super::read::{Archive, Frame, PART, check_sums, expect};
use super::{FormatError, Members, wrong};
use crate::basis::{NUMBERS_OF_SHARE, Part, PartCount, PartPlan, PartShare, PartSlice, StoredPart};

/// More slices than this no part has.
const MOST_SLICES: usize = 1000;

/// A text is no longer than this: parameters may hold a number for each vertex and face.
const MOST_HEAD: u64 = 256 << 20;

/// Rows that are written at once.
const ROWS_AT_ONCE: usize = 256;

/// What the text says.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    plan: PartPlan,
    number: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    given_up: Option<String>,
    slices: Vec<HeadSlice>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    share: Option<HeadShare>,
    about: serde_json::Value,
}

#[derive(Debug, Serialize, Deserialize)]
struct HeadSlice {
    from: usize,
    count: PartCount,
}

/// Of an approximation, what is no array.
#[derive(Debug, Serialize, Deserialize)]
struct HeadShare {
    stiffness_norm: f64,
    orthonormality_defect: f64,
}

fn names(slice: usize) -> [String; 2] {
    [format!("values_{slice}"), format!("vectors_{slice}")]
}

/// Writes a part. `about` comes back when it is read.
///
/// # Errors
/// As [`write()`](super::write()).
pub fn write_part<W: Write + Seek>(part: &Part, about: &serde_json::Value, out: W) -> Result<(), FormatError> {
    let mut members = Members { archive: ZipWriter::new(out) };
    let (slices, given_up) = match &part.slices {
        Ok(slices) => (&slices[..], None),
        Err(reason) => (&[][..], Some(reason.clone())),
    };
    let head = Head {
        plan: part.plan.clone(),
        number: part.number,
        given_up,
        slices: slices.iter().map(|slice| HeadSlice { from: slice.from, count: slice.count }).collect(),
        share: part.share.as_ref().map(|share| HeadShare {
            stiffness_norm: share.stiffness_norm,
            orthonormality_defect: share.orthonormality_defect,
        }),
        about: about.clone(),
    };
    let text = serde_json::to_string(&head).map_err(|error| wrong("part", error.to_string()))?;
    members.text("part", &text)?;
    for (number, slice) in slices.iter().enumerate() {
        let [values, vectors] = names(number);
        members.floats(&values, &slice.values)?;
        let (n, k) = (slice.vectors.rows(), slice.vectors.columns());
        members.begin(&vectors, "<f8", false, &[n, k], 8 * (n * k) as u64)?;
        let mut rows = Vec::with_capacity(k * ROWS_AT_ONCE);
        for start in (0..n).step_by(ROWS_AT_ONCE) {
            rows.clear();
            for row in start..n.min(start + ROWS_AT_ONCE) {
                for (panel, at) in slice.vectors.panels().iter().zip((0..k).step_by(PANEL_WIDTH)) {
                    let from = row * PANEL_WIDTH;
                    rows.extend_from_slice(&panel[from..from + PANEL_WIDTH.min(k - at)]);
                }
            }
            members.archive.write_all(bytemuck::cast_slice(&rows))?;
        }
    }
    if let Some(share) = &part.share {
        let rows = [share.rows.len()];
        members.add("rows", "<u4", false, &rows, bytemuck::cast_slice(&share.rows))?;
        members.pattern("", &share.space)?;
        let values = bytemuck::cast_slice(share.space.values());
        members.add("data", "<f4", false, &[share.space.entries()], values)?;
        members.floats("values", &share.values)?;
        members.floats("coefficients", share.coefficients.values())?;
        members.floats("sums", &share.sums)?;
    }
    members.archive.finish()?.flush()?;
    Ok(())
}

/// What a part holds of an approximation with so many functions.
fn share(archive: &mut Archive<'_>, head: HeadShare, columns: usize) -> Result<PartShare, FormatError> {
    let rows: Vec<u32> = archive.member("rows")?.values("<u4")?;
    let space = archive.sparse(["data", "indices", "indptr"], rows.len(), columns, "<f4")?;
    let values: Vec<f64> = archive.member("values")?.values("<f8")?;
    let size = |each: usize| values.len().checked_mul(each).ok_or_else(|| wrong("values", "there are too many"));
    let coefficients = archive.member("coefficients")?.vector("<f8", size(columns)?)?;
    let coefficients = DenseMatrix::from_columns(columns, values.len(), coefficients);
    let sums = archive.member("sums")?.vector("<f8", size(NUMBERS_OF_SHARE)?)?;
    let HeadShare { stiffness_norm, orthonormality_defect } = head;
    Ok(PartShare { rows, space, values, coefficients, sums, stiffness_norm, orthonormality_defect })
}

/// Reads a part from the bytes of an NPZ file that [`write_part`] made, every member compared with its checksum; and
/// what was written about it.
///
/// # Errors
/// [`FormatError`] names the member that is missing, damaged or of another shape than the rest.
pub fn read_part(bytes: &[u8]) -> Result<(Part, serde_json::Value), FormatError> {
    check_sums(bytes)?;
    let head = Archive::open(Frame::whole(bytes))?.member("part")?.json()?;
    let head: Head = serde_json::from_value(head).map_err(|error| wrong("part", error.to_string()))?;
    if head.slices.len() > MOST_SLICES {
        return Err(wrong("part", format!("it has {} slices", head.slices.len())));
    }
    let Head { plan, number, given_up, slices, share: of_share, about } = head;
    let names: Vec<[String; 2]> = (0..slices.len()).map(names).collect();
    let mut archive = Archive::open(Frame::whole(bytes))?;
    let mut found = Vec::with_capacity(slices.len());
    for (HeadSlice { from, count }, [values, vectors]) in slices.into_iter().zip(&names) {
        let member = archive.member(values)?;
        let values: Vec<f64> = member.vector("<f8", member.shape.first().copied().unwrap_or(0))?;
        let member = archive.member(vectors)?;
        let (n, k) = (plan.problem.unknowns, values.len());
        if member.shape != [n, k] || member.fortran {
            return Err(wrong(vectors, format!("its shape is {:?}, not ({n}, {k})", member.shape)));
        }
        found.push(PartSlice { from, values, vectors: panels(&member.values("<f8")?, n, k), count });
    }
    let slices = given_up.map_or(Ok(found), Err);
    let share = match (of_share, plan.columns) {
        (Some(head), Some(columns)) if columns < u32::MAX as usize => Some(share(&mut archive, head, columns)?),
        (None, None) => None,
        _ => return Err(wrong("part", "it is neither a part of an approximation nor of a spectrum")),
    };
    Ok((Part { plan, number, slices, share }, about))
}

/// The plan of a part, its number, and what was written about it, from a file of which nothing else is read.
///
/// # Errors
/// [`FormatError`] where that is no part.
pub fn read_part_head<R: Read + Seek>(file: R) -> Result<(PartPlan, usize, serde_json::Value), FormatError> {
    let mut archive = ZipArchive::new(file)?;
    expect(&archive, PART)?;
    let mut bytes = Vec::new();
    archive.by_name("part.npy")?.take(MOST_HEAD).read_to_end(&mut bytes)?;
    let (_, text) = NpyHeader::parse(&bytes).map_err(|error| wrong("part", error.to_string()))?;
    let head: Head = serde_json::from_slice(text).map_err(|error| wrong("part", error.to_string()))?;
    Ok((head.plan, head.number, head.about))
}

impl StoredPart {
    /// Encodes a part, with what is to be known about it.
    ///
    /// # Errors
    /// [`FormatError`], as [`write_part`].
    pub fn new(part: &Part, about: serde_json::Value) -> Result<Self, FormatError> {
        let numbers = part.slices.iter().flatten().map(|slice| slice.values.len() * (slice.vectors.rows() + 1));
        let of_share = part.share.as_ref().map_or(0, |share| {
            let rows = 3 * share.rows.len() + 2 * share.space.entries();
            4 * rows + 8 * (share.values.len() + share.coefficients.values().len() + share.sums.len())
        });
        let mut out = Cursor::new(Vec::with_capacity(8 * numbers.sum::<usize>() + of_share + (1 << 14)));
        write_part(part, &about, &mut out)?;
        Ok(Self::of_file(out.into_inner(), part.plan.clone(), part.number, about))
    }

    /// Takes up what [`new`](Self::new) encoded. Of the slices nothing is looked at.
    ///
    /// # Errors
    /// [`FormatError`] where that is no part.
    pub fn of_bytes(content: Vec<u8>) -> Result<Self, FormatError> {
        let (plan, number, about) = read_part_head(Cursor::new(&content))?;
        Ok(Self::of_file(content, plan, number, about))
    }
}

/// Rows of `k` numbers as panels.
fn panels(rows: &[f64], n: usize, k: usize) -> PanelMatrix {
    let mut vectors = PanelMatrix::zeros(n, k);
    for (panel, at) in vectors.panels_mut().iter_mut().zip((0..k).step_by(PANEL_WIDTH)) {
        let width = PANEL_WIDTH.min(k - at);
        for (to, row) in panel.as_chunks_mut::<PANEL_WIDTH>().0.iter_mut().zip(rows.chunks_exact(k)) {
            to[..width].copy_from_slice(&row[at..at + width]);
        }
    }
    vectors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Fingerprint;
    use chladni_algebra::SparseMatrix;
    use chladni_base::SplitMix64;
    use serde_json::json;

    fn part(widths: &[usize]) -> Part {
        let mut random = SplitMix64::new(2);
        let slice = |from: usize, k: usize, random: &mut SplitMix64| {
            let mut vectors = PanelMatrix::zeros(300, k);
            let rows: Vec<f64> = (0..300 * k).map(|_| random.signed_unit()).collect();
            for (column, at) in (0..k).map(|column| (column, column % PANEL_WIDTH)) {
                for row in 0..300 {
                    vectors.panels_mut()[column / PANEL_WIDTH][row * PANEL_WIDTH + at] = rows[row * k + column];
                }
            }
            let values = (0..k).map(|column| 0.1 + (from + column) as f64).collect();
            PartSlice { from, values, vectors, count: PartCount { shift: 3.7e-5, below: from + 3, radius: 1e-300 } }
        };
        let plan = PartPlan {
            version: "0.1.0+7".to_owned(),
            problem: Fingerprint { unknowns: 300, entries: 2000, products: [0.1, 1.0 / 3.0, 2e-308, 4e300, 5.0, 6.0] },
            parts: 3,
            slices: widths.len(),
            pairs: 400,
            kernel: 1,
            tolerance: 1e-6,
            seed: u64::MAX,
            columns: None,
        };
        let slices = widths.iter().enumerate().map(|(number, &k)| slice(number * 70, k, &mut random)).collect();
        Part { plan, number: 1, slices: Ok(slices), share: None }
    }

    fn part_of_surface() -> Part {
        let space =
            SparseMatrix::new(3, 4, vec![0, 2, 2, 5], vec![0, 3, 1, 2, 3], vec![0.5f32, 0.5, 1e-9, 1.0, 0.25]).unwrap();
        let share = PartShare {
            rows: vec![2, 7, u32::MAX - 1],
            space,
            values: vec![0.0, 12.5],
            coefficients: DenseMatrix::from_columns(4, 2, vec![1.0, -2.0, 3.0, 0.1, 5.0, 6.0, 7.0, 1e-300]),
            sums: (0..2 * NUMBERS_OF_SHARE).map(|k| 1.0 / (1 + k) as f64).collect(),
            stiffness_norm: 16.1,
            orthonormality_defect: 1e-14,
        };
        let part = part(&[]);
        Part { plan: PartPlan { columns: Some(4), slices: 0, ..part.plan }, share: Some(share), ..part }
    }

    fn written(part: &Part) -> Vec<u8> {
        let mut out = std::io::Cursor::new(Vec::new());
        write_part(part, &json!({"count": 7}), &mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn a_part_comes_back_bit_by_bit() {
        for widths in [&[86][..], &[64, 97], &[1], &[]] {
            let part = part(widths);
            let bytes = written(&part);
            let head = read_part_head(std::io::Cursor::new(&bytes)).unwrap();
            assert_eq!(head, (part.plan.clone(), part.number, json!({"count": 7})), "{widths:?}");
            assert_eq!(read_part(&bytes).unwrap(), (part, json!({"count": 7})), "{widths:?}");
        }
        let given_up = Part { slices: Err("no shift was found".to_owned()), ..part(&[]) };
        assert_eq!(read_part(&written(&given_up)).unwrap().0, given_up);
    }

    #[test]
    fn a_part_of_a_surface_comes_back_bit_by_bit() {
        let part = part_of_surface();
        let bytes = written(&part);
        assert_eq!(read_part(&bytes).unwrap(), (part.clone(), json!({"count": 7})));
        let stored = StoredPart::new(&part, json!({})).unwrap();
        assert_eq!(StoredPart::of_bytes(stored.content().to_vec()).unwrap(), stored);
        // Its head says how many functions there are; without that number it is no part of an approximation.
        let wrong = Part { plan: PartPlan { columns: None, ..part.plan.clone() }, ..part };
        assert!(read_part(&written(&wrong)).unwrap_err().to_string().contains("approximation"));
    }

    #[test]
    fn any_byte_that_changed_is_found_or_changes_nothing() {
        any_byte_that_changed(&part(&[5]));
        any_byte_that_changed(&part_of_surface());
    }

    fn any_byte_that_changed(part: &Part) {
        let part = part.clone();
        let bytes = written(&part);
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            if let Ok((read, about)) = read_part(&damaged) {
                assert_eq!((&read, &about), (&part, &json!({"count": 7})), "byte {at}");
            }
        }
        for end in (0..bytes.len()).step_by(97) {
            assert!(read_part(&bytes[..end]).is_err(), "cut at {end}");
        }
    }
}
