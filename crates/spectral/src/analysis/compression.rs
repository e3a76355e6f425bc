//! Spectral compression of functions on a mesh, coordinates above all (Karni and Gotsman 2000): coefficients in a
//! basis, rounded and packed.
//!
//! The receiver has the basis; what is sent is a few bytes a coefficient. Since the basis is orthonormal, an error of a
//! coefficient is an error of the function of the same norm, and equal steps for all coefficients are best.
//!
//! Where a surface lies far from the origin, coefficients of the constant dwarf all others, and equal steps leave
//! nothing of the shape. Means of functions are then sent as they are, and the coefficients are those of what is left;
//! for a basis that holds the constant.
//!
//! The form, little-endian: `CHLC`, version as u32, then u32 `m` (modes), u32 `k` (functions), u32 `n` (vertices), f64
//! step; in version 2 `k` means as f64, where version 1 has none; the rest is zstd of the rounded coefficients as i32,
//! mode after mode within a function, their bytes zigzagged and split into planes, lowest bytes first.

use chladni_algebra::DenseMatrix;

use super::error::{self, AnalysisError};
use crate::basis::Basis;

const MAGIC: &[u8; 4] = b"CHLC";
/// Without means of the functions, and with them.
const BARE: u32 = 1;
const WITH_MEANS: u32 = 2;
const HEADER: usize = 4 + 4 * 4 + 8;

/// The most bits of a coefficient.
pub const MOST_BITS: u32 = 30;

/// The most functions at once.
pub const MOST_FUNCTIONS: usize = 256;

/// Means are sent beside the coefficients where one is so many times as large as the function is apart from it.
const FAR: f64 = 16.0;

/// Constants are in the span of the modes where no more than this share of the square of their norm is missing: modes
/// may be in single precision.
const MISSING: f64 = 1e-4;

/// How hard zstd tries: coefficients are few.
const LEVEL: i32 = 19;

/// Compressed functions, and what that costs.
#[derive(Debug, Clone, PartialEq)]
pub struct Compressed {
    /// The bytes.
    pub bytes: Vec<u8>,
    /// The width of a step of the rounding, in the units of the coefficients.
    pub step: f64,
    /// Coefficients that are not zero after rounding.
    pub nonzeros: usize,
    /// Per function `‖x − x'‖_M / ‖x − x̄‖_M`, the mean `x̄` taken off so that the place of the mesh does not matter.
    pub relative_errors: Vec<f64>,
    /// The same without rounding: what the modes that are kept cannot hold.
    pub truncation_errors: Vec<f64>,
    /// What the receiver puts together, `n × k`.
    pub reconstruction: DenseMatrix,
}

/// Compresses `k` functions, `n × k`, to their first `pairs` coefficients, of which the largest gets `bits` bits.
///
/// # Errors
/// [`AnalysisError`] names a count out of its range; functions that do not fit the basis; bytes that could not be
/// compressed.
pub fn compress(basis: &Basis, functions: &DenseMatrix, pairs: usize, bits: u32) -> Result<Compressed, AnalysisError> {
    error::count("pairs", pairs, 1, basis.count())?;
    error::count("bits", bits as usize, 2, MOST_BITS as usize)?;
    error::count("functions", functions.columns(), 1, MOST_FUNCTIONS)?;
    let means = far_means(basis, functions, pairs)?;
    let mut coefficients = match &means {
        None => basis.project(functions)?,
        Some(means) => basis.project(&moved(functions, means, -1.0))?,
    };
    for column in 0..coefficients.columns() {
        coefficients.column_mut(column)[pairs..].fill(0.0);
    }
    let evaluated = |coefficients: &DenseMatrix| -> Result<DenseMatrix, AnalysisError> {
        let values = basis.evaluate(coefficients)?;
        Ok(match &means {
            None => values,
            Some(means) => moved(&values, means, 1.0),
        })
    };
    let truncated = evaluated(&coefficients)?;
    let largest = coefficients.values().iter().fold(0.0f64, |most, value| most.max(value.abs()));
    if !largest.is_finite() {
        let (parameter, value) = ("largest coefficient", largest);
        return Err(AnalysisError::Parameter { parameter, value, expected: "a finite number" });
    }
    let step = if largest > 0.0 { largest / f64::from((1u32 << (bits - 1)) - 1) } else { 1.0 };
    let mut rounded = Vec::with_capacity(pairs * functions.columns());
    for column in 0..coefficients.columns() {
        for value in &mut coefficients.column_mut(column)[..pairs] {
            let whole = (*value / step).round();
            rounded.push(whole as i32);
            *value = whole * step;
        }
    }
    let reconstruction = evaluated(&coefficients)?;
    let sizes = [pairs, functions.columns(), basis.vertices()];
    let bytes = pack(&rounded, sizes, step, means.as_deref())?;
    Ok(Compressed {
        step,
        nonzeros: rounded.iter().filter(|&&value| value != 0).count(),
        relative_errors: errors(basis, functions, &reconstruction)?,
        truncation_errors: errors(basis, functions, &truncated)?,
        bytes,
        reconstruction,
    })
}

/// Puts compressed functions together again, `n × k`.
///
/// # Errors
/// [`AnalysisError::Stream`] where the bytes are damaged or of another basis.
pub fn decompress(basis: &Basis, bytes: &[u8]) -> Result<DenseMatrix, AnalysisError> {
    let Unpacked { rounded, pairs, columns, step, means } = unpack(bytes, basis)?;
    let mut coefficients = DenseMatrix::zeros(basis.count(), columns);
    for (column, values) in rounded.chunks_exact(pairs).enumerate() {
        let slots = coefficients.column_mut(column).iter_mut().zip(values);
        slots.for_each(|(slot, &value)| *slot = f64::from(value) * step);
    }
    let values = basis.evaluate(&coefficients)?;
    Ok(if means.is_empty() { values } else { moved(&values, &means, 1.0) })
}

/// Means of functions, where one of them dwarfs its function and the first modes hold constants.
fn far_means(basis: &Basis, functions: &DenseMatrix, pairs: usize) -> Result<Option<Vec<f64>>, AnalysisError> {
    let masses = basis.mass.lumped();
    let total: f64 = masses.iter().sum();
    let mean = |column: usize| masses.iter().zip(functions.column(column)).map(|(m, x)| m * x).sum::<f64>() / total;
    let means: Vec<f64> = (0..functions.columns()).map(mean).collect();
    if !means.iter().all(|mean| mean.is_finite()) {
        return Ok(None);
    }
    let norms = basis.norms(&moved(functions, &means, -1.0))?;
    let is_far = |(mean, norm): (&f64, &f64)| mean.abs() * total.sqrt() > FAR * norm;
    if !means.iter().zip(&norms).any(is_far) {
        return Ok(None);
    }
    let one = DenseMatrix::from_columns(functions.rows(), 1, vec![1.0; functions.rows()]);
    let held: f64 = basis.project(&one)?.column(0)[..pairs].iter().map(|c| c * c).sum();
    Ok((held >= (1.0 - MISSING) * total).then_some(means))
}

/// Functions with a share of their means added.
fn moved(functions: &DenseMatrix, means: &[f64], share: f64) -> DenseMatrix {
    let mut moved = functions.clone();
    for (column, mean) in means.iter().enumerate() {
        moved.column_mut(column).iter_mut().for_each(|x| *x += share * mean);
    }
    moved
}

/// Errors in the norm of the mass, relative to how far functions are from their means.
fn errors(basis: &Basis, functions: &DenseMatrix, other: &DenseMatrix) -> Result<Vec<f64>, AnalysisError> {
    let masses = basis.mass.lumped();
    let total: f64 = masses.iter().sum();
    let (mut lost, mut spread) = (functions.clone(), functions.clone());
    lost.values_mut().iter_mut().zip(other.values()).for_each(|(x, y)| *x -= y);
    for column in 0..functions.columns() {
        let mean = masses.iter().zip(functions.column(column)).map(|(m, x)| m * x).sum::<f64>() / total;
        spread.column_mut(column).iter_mut().for_each(|x| *x -= mean);
    }
    // A function that hardly differs from its mean is measured against itself.
    let sizes = basis.norms(&spread)?.into_iter().zip(basis.norms(functions)?);
    let sizes = sizes.map(|(spread, whole)| spread.max(1e-9 * whole));
    let norms = basis.norms(&lost)?.into_iter().zip(sizes);
    Ok(norms.map(|(lost, size)| if lost == 0.0 || size == 0.0 { 0.0 } else { lost / size }).collect())
}

fn pack(values: &[i32], sizes: [usize; 3], step: f64, means: Option<&[f64]>) -> Result<Vec<u8>, AnalysisError> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(if means.is_some() { WITH_MEANS } else { BARE }.to_le_bytes());
    sizes.iter().for_each(|&size| bytes.extend((size as u32).to_le_bytes()));
    bytes.extend(step.to_le_bytes());
    means.into_iter().flatten().for_each(|mean| bytes.extend(mean.to_le_bytes()));
    let planes = planes(values);
    let refused = |error: std::io::Error| AnalysisError::Compression { bytes: planes.len(), reason: error.to_string() };
    bytes.extend(zstd::bulk::compress(&planes, LEVEL).map_err(refused)?);
    Ok(bytes)
}

/// Bytes of zigzagged values, lowest bytes first.
fn planes(values: &[i32]) -> Vec<u8> {
    let zigzag = values.iter().map(|&value| ((value << 1) ^ (value >> 31)) as u32);
    let mut planes = vec![0; 4 * values.len()];
    for (k, value) in zigzag.enumerate() {
        for (plane, byte) in value.to_le_bytes().into_iter().enumerate() {
            planes[plane * values.len() + k] = byte;
        }
    }
    planes
}

/// What compressed functions consist of.
struct Unpacked {
    rounded: Vec<i32>,
    pairs: usize,
    columns: usize,
    step: f64,
    /// Of each function, or none.
    means: Vec<f64>,
}

fn unpack(bytes: &[u8], basis: &Basis) -> Result<Unpacked, AnalysisError> {
    let refuse = |at: usize, reason: &'static str| AnalysisError::Stream { at, reason };
    if bytes.len() < HEADER {
        return Err(refuse(bytes.len(), "the header ends early"));
    }
    if bytes[..4] != MAGIC[..] {
        return Err(refuse(0, "these are not compressed functions"));
    }
    let (words, _) = bytes[4..20].as_chunks::<4>();
    let [version, pairs, columns, vertices] = [0, 1, 2, 3].map(|k| u32::from_le_bytes(words[k]) as usize);
    if version != BARE as usize && version != WITH_MEANS as usize {
        return Err(refuse(4, "the version is unknown"));
    }
    if vertices != basis.vertices() {
        return Err(refuse(16, "they belong to a mesh with a different number of vertices"));
    }
    if !(1..=basis.count()).contains(&pairs) {
        return Err(refuse(8, "the number of modes is zero or exceeds that of the basis"));
    }
    if !(1..=MOST_FUNCTIONS).contains(&columns) {
        return Err(refuse(12, "the number of functions is zero or too large"));
    }
    let mut word = [0; 8];
    word.copy_from_slice(&bytes[20..HEADER]);
    let step = f64::from_le_bytes(word);
    if !(step.is_finite() && step > 0.0) {
        return Err(refuse(20, "the step is not a positive number"));
    }
    let means = if version == WITH_MEANS as usize { columns } else { 0 };
    let Some(means) = bytes.get(HEADER..HEADER + 8 * means) else {
        return Err(refuse(bytes.len(), "the means end early"));
    };
    let packed = &bytes[HEADER + means.len()..];
    let means: Vec<f64> = means.as_chunks::<8>().0.iter().map(|&word| f64::from_le_bytes(word)).collect();
    if !means.iter().all(|mean| mean.is_finite()) {
        return Err(refuse(HEADER, "a mean is not a finite number"));
    }
    let count = pairs * columns;
    // At most this much memory is taken, whatever the bytes say.
    let planes =
        zstd::bulk::decompress(packed, 4 * count).map_err(|_| refuse(HEADER, "the coefficients are damaged"))?;
    if planes.len() != 4 * count {
        return Err(refuse(HEADER, "the number of coefficients differs from the header"));
    }
    let value = |k: usize| {
        let word = u32::from_le_bytes([0, 1, 2, 3].map(|plane| planes[plane * count + k]));
        (word >> 1) as i32 ^ -((word & 1) as i32)
    };
    Ok(Unpacked { rounded: (0..count).map(value).collect(), pairs, columns, step, means })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::{chain, dense};

    fn functions(n: usize) -> DenseMatrix {
        let wave = |i: usize| (i as f64 * 0.11).sin() + 0.2 * (i as f64 * 0.31).cos() + 5.0;
        DenseMatrix::from_columns(n, 2, (0..2 * n).map(wave).collect())
    }

    #[test]
    fn what_is_put_together_is_what_was_announced() {
        for basis in [chain(90, 40), dense(&chain(90, 40))] {
            let x = functions(90);
            for (pairs, bits) in [(40, 30), (40, 12), (17, 8), (1, 2)] {
                let packed = compress(&basis, &x, pairs, bits).unwrap();
                assert_eq!(decompress(&basis, &packed.bytes).unwrap(), packed.reconstruction);
                for (error, truncation) in packed.relative_errors.iter().zip(&packed.truncation_errors) {
                    assert!(error >= &(truncation * (1.0 - 1e-9)));
                    // Rounding loses at most half a step a coefficient.
                    let spread = 0.5 * packed.step * (pairs as f64).sqrt();
                    assert!(error - truncation <= spread, "{pairs} {bits}: {error} {truncation}");
                }
                assert!(packed.nonzeros <= 2 * pairs);
            }
        }
    }

    #[test]
    fn what_lies_far_from_the_origin_keeps_its_shape() {
        let basis = chain(90, 40);
        let near = functions(90);
        let far = moved(&near, &[3e6, 0.0], 1.0);
        let (near, far) = (compress(&basis, &near, 40, 14).unwrap(), compress(&basis, &far, 40, 14).unwrap());
        assert_eq!((near.bytes[4], far.bytes[4]), (1, 2));
        assert_eq!(decompress(&basis, &far.bytes).unwrap(), far.reconstruction);
        for (near, far) in near.relative_errors.iter().zip(&far.relative_errors) {
            assert!(far < &(1.01 * near + 1e-6), "{far} {near}");
        }
        for length in 0..far.bytes.len() {
            assert!(decompress(&basis, &far.bytes[..length]).is_err(), "{length}");
        }
        let mut bad = far.bytes.clone();
        bad[HEADER..HEADER + 8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(decompress(&basis, &bad).unwrap_err().to_string().contains("mean"));
    }

    #[test]
    fn more_bits_and_more_pairs_cost_more_and_lose_less() {
        let (basis, x) = (chain(90, 60), functions(90));
        let sizes: Vec<(usize, f64)> = [(20, 6), (40, 10), (60, 16)]
            .map(|(pairs, bits)| {
                let packed = compress(&basis, &x, pairs, bits).unwrap();
                (packed.bytes.len(), packed.relative_errors[0])
            })
            .to_vec();
        assert!(sizes.is_sorted_by(|a, b| a.0 < b.0 && a.1 > b.1), "{sizes:?}");
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let (basis, x) = (chain(30, 10), functions(30));
        let good = compress(&basis, &x, 10, 12).unwrap().bytes;
        let text = |bytes: &[u8]| decompress(&basis, bytes).unwrap_err().to_string();
        assert!(
            text(&[]).contains("ends early")
                && text(b"PK\x03\x04-----------------------------").contains("not compressed functions")
        );
        for length in 0..good.len() {
            assert!(decompress(&basis, &good[..length]).is_err(), "{length}");
        }
        for (at, byte, word) in [
            (4, 9, "version"),
            (8, 11, "modes"),
            (8, 0, "modes"),
            (12, 0, "functions is zero"),
            (16, 31, "a different number"),
        ] {
            let mut bad = good.clone();
            bad[at] = byte;
            assert!(text(&bad).contains(word), "{at}: {}", text(&bad));
        }
        for step in [f64::NAN, 0.0, -1.0] {
            let mut bad = good.clone();
            bad[20..28].copy_from_slice(&step.to_le_bytes());
            assert!(text(&bad).contains("step"));
        }
        let other = chain(30, 9);
        assert!(decompress(&other, &good).unwrap_err().to_string().contains("exceeds that of the basis"));
    }

    #[test]
    fn zero_is_compressed_too_and_bad_requests_are_named() {
        let basis = chain(30, 10);
        let packed = compress(&basis, &DenseMatrix::zeros(30, 1), 10, 12).unwrap();
        assert_eq!((packed.relative_errors[0], packed.nonzeros), (0.0, 0));
        assert!(decompress(&basis, &packed.bytes).unwrap().values().iter().all(|x| *x == 0.0));
        let x = functions(30);
        let error = |pairs, bits| compress(&basis, &x, pairs, bits).unwrap_err().to_string();
        assert!(
            error(0, 8).ends_with("pairs must be between 1 and 10, got 0")
                && error(11, 8).ends_with("pairs must be between 1 and 10, got 11")
        );
        assert!(
            error(5, 1).ends_with("bits must be between 2 and 30, got 1")
                && error(5, 31).ends_with("bits must be between 2 and 30, got 31")
        );
    }
}
