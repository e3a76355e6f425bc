//! What readers must survive: a corpus of hostile files, and valid files mutated at random. Every reader answers every
//! input without a panic, in time and memory proportional to the bytes that are there.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use chladni_mesh::read::{MeshFormat, RawMesh, ReadError, ReadLimits, read};
use proptest::prelude::*;

/// Counts what the current thread holds, so that tests can bound what a reader takes.
struct Counting;

thread_local! {
    static HELD: Cell<usize> = const { Cell::new(0) };
    static PEAK: Cell<usize> = const { Cell::new(0) };
}

fn held(change: impl Fn(usize) -> usize) {
    // Fails only while a thread ends, when nothing is measured any more.
    let _ = HELD.try_with(|held| {
        held.set(change(held.get()));
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: every call is passed on to the system's allocator unchanged; counting allocates nothing, since both cells are
// initialised by constants. There is no other way to see what a reader allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        held(|bytes| bytes.saturating_add(layout.size()));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        held(|bytes| bytes.saturating_sub(layout.size()));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most bytes that may be held for each byte of input: a strip of one-byte indices makes a triangle of twelve bytes
/// for each, and a vector that grows holds one and a half times twice that for a moment.
const PER_BYTE: usize = 40;
const ON_TOP: usize = 64 << 10;

/// Reads under the bound on memory; what comes out satisfies what `RawMesh` promises.
fn survive(bytes: &[u8], format: MeshFormat, limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    let before = HELD.get();
    PEAK.set(before);
    let result = read(bytes, format, limits);
    let peak = PEAK.get() - before;
    assert!(peak <= PER_BYTE * bytes.len() + ON_TOP, "{peak} bytes for {} bytes of {format}", bytes.len());
    match &result {
        Ok(mesh) => {
            let vertices = mesh.positions.len();
            assert!(vertices > 0 && vertices <= limits.vertices);
            assert!(mesh.faces.len() <= limits.faces && mesh.tetrahedra.len() <= limits.tetrahedra);
            assert!(mesh.faces.as_flattened().iter().all(|&v| (v as usize) < vertices));
            assert!(mesh.tetrahedra.as_flattened().iter().all(|&v| (v as usize) < vertices));
        }
        Err(error) => {
            assert!(error.to_string().len() < 400, "{error}");
            assert!(error.kind().bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-'));
        }
    }
    result
}

fn kind(bytes: &[u8], format: MeshFormat) -> &'static str {
    survive(bytes, format, &ReadLimits::default()).map_or_else(|error| error.kind(), |_| "no error")
}

/// Arrays as `numpy.savez` writes them.
fn arrays() -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let positions: Vec<u8> =
        [0f64, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5].iter().flat_map(|x| x.to_le_bytes()).collect();
    for (name, kind, shape, data) in [
        ("vertices", "<f8", "3, 3", positions),
        ("faces", "|u1", "1, 3", vec![0, 1, 2]),
        ("tetrahedra", "|u1", "1, 4", vec![0, 1, 2, 1]),
    ] {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}\n");
        archive.start_file(format!("{name}.npy"), stored).unwrap();
        let head = [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &data].concat();
        std::io::Write::write_all(&mut archive, &head).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// Numbers with their highest bytes first.
fn big_endian(floats: &[f32], integers: &[i32]) -> Vec<u8> {
    floats.iter().flat_map(|x| x.to_be_bytes()).chain(integers.iter().flat_map(|x| x.to_be_bytes())).collect()
}

const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5];

fn freesurfer() -> Vec<u8> {
    let head = [&b"\xff\xff\xfecreated by hand\n\n"[..], &big_endian(&[], &[4, 2])].concat();
    [head, big_endian(&SQUARE, &[0, 1, 2, 0, 2, 3])].concat()
}

fn vtk_binary() -> Vec<u8> {
    let mut bytes = b"# vtk DataFile Version 5.1\nt\nBINARY\nDATASET POLYDATA\nPOINTS 4 float\n".to_vec();
    bytes.extend(big_endian(&SQUARE, &[]));
    bytes.extend(b"\nPOLYGONS 3 7\nOFFSETS int\n");
    bytes.extend(big_endian(&[], &[0, 3, 7]));
    bytes.extend(b"\nCONNECTIVITY int\n");
    bytes.extend(big_endian(&[], &[0, 1, 2, 0, 1, 2, 3]));
    bytes.extend(b"\nTRIANGLE_STRIPS 2 4\nOFFSETS int\n");
    bytes.extend(big_endian(&[], &[0, 4]));
    bytes.extend(b"\nCONNECTIVITY int\n");
    bytes.extend(big_endian(&[], &[0, 1, 2, 3]));
    bytes
}

/// A tetrahedron or a square in every format and encoding.
fn seeds() -> Vec<(MeshFormat, Vec<u8>)> {
    let obj = "mtllib a.mtl\no a\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1e0 0.0\nv 0 1 -0\nvt 0 0\nvn 0 0 1\ng b\nusemtl m\n\
               f 1/1/1 2//1 3/1\nf 1 3 4\nf -4 -3 -2 -1\nf 1 2 \\\n3\n";
    let off = "COFF # square\n4 2 5\n0 0 0 255 0 0\n1 0 0\n1 1 0\n0 1.5e-3 nan\n3 0 1 2\n4 0 1 2 3 0.5\n";
    let medit = "MeshVersionFormatted 2\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 1\n0 0 1 0\nTriangles\n2\n1 2 3 0\n1 2 4 0\n\
                 Quadrilaterals 1 1 2 3 4 0\nTetrahedra\n1\n1 2 3 4 0\nRidges\n1\n1\nEnd\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1e0 0\nendloop\nendfacet\nendsolid a\n";
    let json = r#"{"name": [{"a": null}], "vertices": [[0, 0, 0], [1, 0, 0], [1, 1e0, 0], [0, 1, -0.5]], "faces": [[0, 1, 2], [0, 1, 2, 3], []], "tetrahedra": [[0, 1, 2, 3]]}"#;
    let vtk = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\na 1 1 int\n7\nPOINTS 4 float\n0 0 0 1 0 0 1 1e0 0 0 1 -0.5\n\
               METADATA\nINFORMATION 0\n\nCELLS 4 18\n3 0 1 2\n4 0 1 2 3\n4 0 1 2 3\n3 0 1 2\nCELL_TYPES 4\n5 9 10 6\nPOINT_DATA 4\n";
    let gmsh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n9 1 1e0 0\n4 0 1 -0.5\n$EndNodes\n\
                $Elements\n3\n1 2 2 0 1 1 2 9\n2 3 0 1 2 9 4\n3 4 1 0 1 2 9 4\n$EndElements\n";
    let gmsh_of_blocks = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 3\n2 1 1 3\n1\n2\n3\n0 0 0 1 1\n1 0 0 1 1\n1 1 0 1 1\n$EndNodes\n\
                          $Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n";
    let mut seeds = vec![
        (MeshFormat::Obj, obj.into()),
        (MeshFormat::Off, off.into()),
        (MeshFormat::Medit, medit.into()),
        (MeshFormat::Medit, include_bytes!("../src/read/data/mixed.meshb").to_vec()),
        (MeshFormat::Stl, stl.into()),
        (MeshFormat::Json, json.into()),
        (MeshFormat::Vtk, vtk.into()),
        (MeshFormat::Vtk, vtk_binary()),
        (MeshFormat::Vtk, include_bytes!("../src/read/data/grid-ascii.vtu").to_vec()),
        (MeshFormat::Vtk, include_bytes!("../src/read/data/mixed-zlib.vtp").to_vec()),
        (MeshFormat::Vtk, include_bytes!("../src/read/data/mixed-raw.vtp").to_vec()),
        (MeshFormat::Vtk, include_bytes!("../src/read/data/mixed-base64.vtp").to_vec()),
        (MeshFormat::Gmsh, gmsh.into()),
        (MeshFormat::Gmsh, gmsh_of_blocks.into()),
        (MeshFormat::Gmsh, include_bytes!("../src/read/data/grid-2.2.msh").to_vec()),
        (MeshFormat::Gmsh, include_bytes!("../src/read/data/grid-4.1.msh").to_vec()),
        (MeshFormat::FreeSurfer, freesurfer()),
        (MeshFormat::Gltf, include_bytes!("../src/read/data/scene.glb").to_vec()),
        (MeshFormat::Gltf, include_bytes!("../src/read/data/strip-and-fan.gltf").to_vec()),
        (MeshFormat::Gifti, include_bytes!("../src/read/data/ascii.surf.gii").to_vec()),
        (MeshFormat::Gifti, include_bytes!("../src/read/data/gzip.surf.gii").to_vec()),
        (MeshFormat::Npz, arrays()),
    ];
    let mut binary = b"solid but binary".to_vec();
    binary.resize(80, 0);
    binary.extend(2u32.to_le_bytes());
    binary.extend((0..100).map(|byte| byte as u8));
    seeds.push((MeshFormat::Stl, binary));
    let header = |encoding: &str| {
        format!(
            "ply\nformat {encoding} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty double z\n\
             property uchar red\nelement tristrips 1\nproperty list int short vertex_indices\n\
             element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let ascii = header("ascii") + "0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n7 0 1 2 3 -1 0 1\n3 0 1 2\n4 0 1 2 3\n";
    seeds.push((MeshFormat::Ply, ascii.into()));
    for big in [false, true] {
        let mut bytes = header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
        let mut put = |mut number: Vec<u8>| {
            if big {
                number.reverse();
            }
            bytes.extend(number);
        };
        for [x, y, z] in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]] {
            put(x.to_le_bytes().to_vec());
            put(y.to_le_bytes().to_vec());
            put(f64::from(z).to_le_bytes().to_vec());
            put(vec![9]);
        }
        put(5i32.to_le_bytes().to_vec());
        for index in [0i16, 1, 2, -1, 3] {
            put(index.to_le_bytes().to_vec());
        }
        for face in [&[0i32, 1, 2][..], &[0, 1, 2, 3]] {
            put(vec![face.len() as u8]);
            for index in face {
                put(index.to_le_bytes().to_vec());
            }
        }
        seeds.push((MeshFormat::Ply, bytes));
    }
    seeds
}

#[test]
fn the_seeds_are_valid_and_recognised() {
    for (format, bytes) in seeds() {
        let mesh = survive(&bytes, format, &ReadLimits::default())
            .unwrap_or_else(|error| panic!("{error} in {}", String::from_utf8_lossy(&bytes)));
        assert!(!mesh.faces.is_empty() || !mesh.tetrahedra.is_empty());
        assert_eq!(MeshFormat::sniff(&bytes), Some(format));
    }
}

#[test]
fn every_prefix_of_a_valid_file_is_answered() {
    for (format, bytes) in seeds() {
        for length in 0..bytes.len() {
            let _ = survive(&bytes[..length], format, &ReadLimits::default());
        }
    }
}

#[test]
fn every_file_is_answered_by_every_reader() {
    for (_, bytes) in seeds() {
        for format in MeshFormat::ALL {
            let _ = survive(&bytes, format, &ReadLimits::default());
        }
    }
}

#[test]
fn a_material_library_is_never_opened() {
    let text = b"mtllib ../../../../etc/passwd\nmtllib /dev/zero\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl root\nf 1 2 3\n";
    assert_eq!(survive(text, MeshFormat::Obj, &ReadLimits::default()).unwrap().faces, [[0, 1, 2]]);
}

/// Anything quadratic here would take hours.
#[test]
fn groups_long_lines_and_deep_numbers_take_linear_time() {
    let mut groups = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    for group in 0..200_000 {
        groups += &format!("g part{group}\nusemtl m{group}\nf 1 2 3\n");
    }
    let mesh = survive(groups.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
    assert_eq!((mesh.positions.len(), mesh.faces.len()), (3, 200_000));

    let mut long = b"v 0 0 0\n# ".to_vec();
    long.resize(50 << 20, b'x');
    assert_eq!(kind(&long, MeshFormat::Obj), "no error");
    long[8] = b'v';
    assert_eq!(kind(&long, MeshFormat::Obj), "not-a-number");
    let mut digits = b"v 0.".to_vec();
    digits.resize(50 << 20, b'3');
    digits.extend(b" 0 0\n");
    let mesh = survive(&digits, MeshFormat::Obj, &ReadLimits::default()).unwrap();
    assert_eq!(mesh.positions[0][0], 1.0 / 3.0);
    let corners =
        b"v 0 0 0\nf".iter().copied().chain(b" 1".iter().copied().cycle().take(50 << 20)).collect::<Vec<u8>>();
    assert_eq!(kind(&corners, MeshFormat::Obj), "polygon-too-large");
    let unlimited = ReadLimits { corners_per_polygon: usize::MAX, ..Default::default() };
    assert_eq!(survive(&corners, MeshFormat::Obj, &unlimited).unwrap().faces.len(), (25 << 20) - 2);
}

#[test]
fn forged_counts_are_refused_before_anything_is_allocated() {
    let huge = [u32::MAX as u64, u64::from(u32::MAX) + 1, i64::MAX as u64];
    for count in huge {
        for text in [format!("OFF\n{count} 1 0\n0 0 0\n"), format!("OFF\n1 {count} 0\n0 0 0\n3 0 0 0\n")] {
            assert_eq!(kind(text.as_bytes(), MeshFormat::Off), "count-exceeds-file");
        }
        for section in ["Vertices", "Triangles", "Quadrilaterals", "Tetrahedra"] {
            let text = format!("MeshVersionFormatted 1\nDimension 3\n{section}\n{count}\n1 1 1 1 0\n");
            assert_eq!(kind(text.as_bytes(), MeshFormat::Medit), "count-exceeds-file");
        }
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for element in ["vertex", "face", "other"] {
                let text = format!(
                    "ply\nformat {encoding} 1.0\nelement {element} {count}\nproperty double x\nproperty double y\nproperty double z\n\
                     property list uchar int vertex_indices\nelement {}vertex 1\nproperty double x\nproperty double y\nproperty double z\n\
                     end_header\n0 0 0 0\n",
                    if element == "vertex" { "another " } else { "" }
                );
                let kind = kind(text.as_bytes(), MeshFormat::Ply);
                assert!(
                    matches!(kind, "count-exceeds-file" | "missing-value" | "not-a-number" | "invalid-count"),
                    "{kind}"
                );
            }
        }
    }
    let mut surface = freesurfer();
    for at in [20, 24] {
        surface[at..at + 4].copy_from_slice(&i32::MAX.to_be_bytes());
        assert_eq!(kind(&surface, MeshFormat::FreeSurfer), "count-exceeds-file");
        surface[at..at + 4].copy_from_slice(&2i32.to_be_bytes());
    }
    for encoding in ["ASCII", "BINARY"] {
        for (section, count) in [
            ("POINTS 4000000000 float", ""),
            ("POLYGONS 4000000000 16000000000", ""),
            ("FIELD a 1\nb 4000000000 4000000000 int", "0"),
        ] {
            let text = format!("# vtk DataFile Version 3.0\nt\n{encoding}\nDATASET POLYDATA\n{section}\n{count}");
            assert!(
                matches!(kind(text.as_bytes(), MeshFormat::Vtk), "count-exceeds-file" | "truncated-file"),
                "{text}"
            );
        }
    }
    for section in
        ["$Nodes\n4000000000\n1 0 0 0\n", "$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n4000000000\n1 2 0 1 1 1\n"]
    {
        let text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{section}");
        assert_eq!(kind(text.as_bytes(), MeshFormat::Gmsh), "count-exceeds-file");
    }
    let mut stl = vec![0; 84];
    stl[80..].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(kind(&stl, MeshFormat::Stl), "count-exceeds-file");
}

#[test]
fn worst_cases_of_memory_stay_below_the_bound() {
    let header = |element: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty char x\nproperty char y\nproperty char z\n\
             {element}\nend_header\n\0\0\0"
        )
        .into_bytes()
    };
    let body = 3 << 20;
    // One strip, then many quadrilaterals, then many triangles, all of one-byte indices to vertex 0.
    let mut strip = header("element vertex2 0\nelement tristrips 1\nproperty list uint uchar vertex_indices");
    strip.extend((body as u32).to_le_bytes());
    strip.resize(strip.len() + body, 0);
    let mut cases = vec![strip];
    for corners in [1u8, 3, 4, 255] {
        let records = body / (1 + corners as usize);
        let mut faces = header(&format!("element face {records}\nproperty list uchar uchar vertex_indices"));
        for _ in 0..records {
            faces.push(corners);
            faces.resize(faces.len() + corners as usize, 0);
        }
        cases.push(faces);
    }
    let mut strip = b"# vtk DataFile Version 5.1\nt\nBINARY\nDATASET POLYDATA\nPOINTS 1 float\n0123456789ab\n".to_vec();
    strip.extend(format!("TRIANGLE_STRIPS 2 {body}\nOFFSETS int\n").bytes());
    strip.extend(big_endian(&[], &[0, body as i32]));
    strip.extend(b"\nCONNECTIVITY char\n");
    strip.resize(strip.len() + body, 0);
    assert_eq!(survive(&strip, MeshFormat::Vtk, &ReadLimits::default()).unwrap().faces.len(), body - 2);
    for bytes in cases {
        survive(&bytes, MeshFormat::Ply, &ReadLimits::default()).unwrap();
    }
    let quads =
        b"v 0 0 0\n".iter().copied().chain(b"f 1 1 1 1\n".iter().copied().cycle().take(body)).collect::<Vec<u8>>();
    let _ = survive(&quads, MeshFormat::Obj, &ReadLimits::default());
    let vertices = b"v 0 0 0\n".iter().copied().cycle().take(body).collect::<Vec<u8>>();
    let _ = survive(&vertices, MeshFormat::Obj, &ReadLimits::default());
}

/// Words that mean something somewhere.
const WORDS: &[&str] = &[
    "0",
    "-1",
    "1",
    "3",
    "255",
    "65536",
    "4294967295",
    "4294967296",
    "-9223372036854775807",
    "99999999999999999999",
    "nan",
    "inf",
    "1e999",
    "1.#IND",
    "3.0",
    "0.5",
    "\\\n",
    "#",
    "\n",
    "\r",
    "f ",
    "v ",
    "OFF",
    "4OFF ",
    "nOFF ",
    "Dimension 2\n",
    "Vertices\n",
    "Tetrahedra\n",
    "End",
    "solid",
    "endloop",
    "vertex ",
    "element vertex ",
    "element face ",
    "property list uchar int vertex_indices\n",
    "property float x\n",
    "end_header\n",
    "POINTS 3 float\n",
    "POLYGONS 1 4\n",
    "OFFSETS int\n",
    "CELL_TYPES ",
    "METADATA\n",
    "FIELD a 1\n",
    "$Nodes\n",
    "$Elements\n",
    "$EndNodes\n",
    "\0",
    "\u{feff}",
    "é",
];

#[derive(Debug, Clone)]
enum Mutation {
    Set(usize, u8),
    Insert(usize, usize),
    Replace(usize, usize),
    Remove(usize, usize),
    Repeat(usize, usize),
    Cut(usize),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    prop_oneof![
        (any::<usize>(), any::<u8>()).prop_map(|(at, byte)| Mutation::Set(at, byte)),
        (any::<usize>(), 0..WORDS.len()).prop_map(|(at, word)| Mutation::Insert(at, word)),
        (any::<usize>(), 0..WORDS.len()).prop_map(|(at, word)| Mutation::Replace(at, word)),
        (any::<usize>(), 1usize..30).prop_map(|(at, length)| Mutation::Remove(at, length)),
        (any::<usize>(), 1usize..60).prop_map(|(at, length)| Mutation::Repeat(at, length)),
        any::<usize>().prop_map(Mutation::Cut),
    ]
}

fn mutate(bytes: &mut Vec<u8>, mutation: &Mutation) {
    if bytes.is_empty() {
        return;
    }
    let length = bytes.len();
    match *mutation {
        Mutation::Set(at, byte) => bytes[at % length] = byte,
        Mutation::Insert(at, word) => {
            bytes.splice(at % length..at % length, WORDS[word].bytes());
        }
        Mutation::Replace(at, word) => {
            // The word that stands there, so that numbers turn into other numbers.
            let at = at % length;
            let start = bytes[..at].iter().rposition(u8::is_ascii_whitespace).map_or(0, |space| space + 1);
            let end = bytes[at..].iter().position(u8::is_ascii_whitespace).map_or(length, |space| at + space);
            bytes.splice(start..end.max(start), WORDS[word].bytes());
        }
        Mutation::Remove(at, count) => {
            let at = at % length;
            bytes.drain(at..(at + count).min(length));
        }
        Mutation::Repeat(at, count) => {
            let at = at % length;
            let part = bytes[at..(at + count).min(length)].to_vec();
            bytes.splice(at..at, part);
        }
        Mutation::Cut(at) => bytes.truncate(at % length),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40_000, failure_persistence: None, max_shrink_iters: 4096, rng_seed: proptest::test_runner::RngSeed::Fixed(20_261_121), ..Default::default() })]

    #[test]
    fn mutated_files_are_answered_within_bounds(seed in 0usize..8, mutations in prop::collection::vec(mutation(), 1..8), small: bool) {
        thread_local! { static SEEDS: Vec<(MeshFormat, Vec<u8>)> = seeds(); }
        let (format, mut bytes) = SEEDS.with(|seeds| seeds[seed].clone());
        for mutation in &mutations {
            mutate(&mut bytes, mutation);
        }
        let limits = if small {
            ReadLimits { vertices: 5, faces: 4, tetrahedra: 1, corners_per_polygon: 4, groups: 6 }
        } else {
            ReadLimits::default()
        };
        let _ = survive(&bytes, format, &limits);
        if let Some(sniffed) = MeshFormat::sniff(&bytes) {
            let _ = survive(&bytes, sniffed, &limits);
        }
    }
}
