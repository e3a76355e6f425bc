use std::sync::Arc;

use super::*;
use crate::basis::tests::{dense_basis, small_basis};
use crate::basis::{ColumnChunk, ColumnError, ColumnSource};

#[test]
fn what_is_written_is_read_back_to_the_bit() {
    for sparse_mass in [false, true] {
        let basis = small_basis(sparse_mass);
        let bytes = to_bytes(&basis).unwrap();
        assert_eq!(read(&bytes).unwrap(), basis);
        assert_eq!(bytes, to_bytes(&basis).unwrap());
    }
}

#[derive(Debug)]
struct Bytes(Vec<u8>, DenseLayout, usize);

impl ColumnSource for Bytes {
    fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, ColumnError> {
        let range = self.1.chunk_bytes(self.2, index);
        let bytes = &self.0[range.start as usize..range.end as usize];
        if blake3::hash(bytes).to_hex().as_str() != self.1.chunks[index] {
            return Err(ColumnError::Failed("damaged".to_owned()));
        }
        ColumnChunk::from_bytes(bytes, self.2, self.1.precision).map(Arc::new).ok_or(ColumnError::Gone)
    }
}

#[test]
fn a_dense_basis_is_read_whole_and_by_its_layout() {
    for precision in [Precision::F32, Precision::F64] {
        let basis = dense_basis(precision, 70);
        let mut bytes = Vec::new();
        let Functions::Dense(functions) = basis.functions.clone() else { panic!() };
        let layout = write_dense(&basis, functions, None, &mut bytes).unwrap();
        assert_eq!(bytes, to_bytes(&basis).unwrap());
        assert_eq!((layout.total, layout.chunks.len()), (bytes.len() as u64, 3));
        assert_eq!(layout.end - layout.start, (3 * 72 * precision.bytes()) as u64);
        assert_eq!(layout.chunk_bytes(3, 2).end, layout.end);
        assert_eq!(read(&bytes).unwrap(), basis);
        let (head, tail) = (bytes[..layout.start as usize].to_vec(), bytes[layout.end as usize..].to_vec());
        let source = Arc::new(Bytes(bytes.clone(), layout.clone(), 3));
        let framed = read_frame(&head, &tail, &layout, [3, 72], source).unwrap();
        assert_eq!(framed, basis);
        // A chunk that is damaged harms its own columns alone.
        let mut damaged = bytes.clone();
        damaged[layout.chunk_bytes(3, 1).start as usize] ^= 1;
        let source = Arc::new(Bytes(damaged, layout.clone(), 3));
        let framed = read_frame(&head, &tail, &layout, [3, 72], source).unwrap();
        assert_eq!(framed.lift::<f64>(0..32).unwrap(), basis.lift::<f64>(0..32).unwrap());
        assert_eq!(framed.lift::<f64>(64..72).unwrap(), basis.lift::<f64>(64..72).unwrap());
        assert_eq!(
            framed.lift::<f64>(31..33).unwrap_err().to_string(),
            "chunk 1 of the eigenfunctions cannot be read: damaged"
        );
        // Columns and all else may travel apart.
        let mut alone = std::io::Cursor::new(Vec::new());
        write_head(&basis, &mut alone).unwrap();
        let Functions::Dense(functions) = basis.functions.clone() else { panic!() };
        assert_eq!(read_head(alone.get_ref(), functions).unwrap(), basis);
        let fewer = DenseFunctions::elsewhere(3, 71, precision, Arc::new(Bytes(Vec::new(), layout.clone(), 3)));
        assert!(read_head(alone.get_ref(), fewer).is_err());
        let source = Arc::new(Bytes(Vec::new(), layout.clone(), 3));
        assert!(read_frame(&head, &tail, &layout, [3, 71], source.clone()).is_err());
        assert!(read_frame(&head[1..], &tail, &layout, [3, 72], source).is_err());
    }
}

#[test]
fn damaged_bytes_are_refused_without_a_panic() {
    for basis in [small_basis(true), dense_basis(Precision::F32, 3)] {
        let bytes = to_bytes(&basis).unwrap();
        for cut in 0..bytes.len() {
            assert!(read(&bytes[..cut]).is_err());
        }
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x5a;
            let _ = read(&damaged);
        }
    }
}

#[test]
fn data_begin_at_a_multiple_of_64_bytes_of_the_member() {
    for shape in [vec![], vec![1], vec![123_456, 7]] {
        assert_eq!(header("<f8", false, &shape).len() % 64, 0);
    }
}

#[test]
fn another_product_is_named_for_what_it_is() {
    let mut members = Members { archive: ZipWriter::new(Cursor::new(Vec::new())) };
    members.floats("masses", &[1.0]).unwrap();
    let bytes = members.archive.finish().unwrap().into_inner();
    assert_eq!(read(&bytes).unwrap_err().to_string(), "the file holds vibration modes; expected an eigenbasis");
}
