//! The readers over real files, where `CHLADNI_MESHES` names a folder of them.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::super::{TriangleMesh, write};
use super::*;

fn folder() -> Option<PathBuf> {
    let folder = std::env::var_os("CHLADNI_MESHES").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: CHLADNI_MESHES is not set");
    }
    folder
}

fn bytes(path: &Path) -> Vec<u8> {
    let stored = std::fs::read(path).unwrap();
    if path.extension().is_some_and(|extension| extension == "gz") {
        let mut bytes = Vec::new();
        flate2::read::GzDecoder::new(stored.as_slice()).read_to_end(&mut bytes).unwrap();
        return bytes;
    }
    stored
}

fn load(path: &Path) -> RawMesh {
    let name = path.file_name().unwrap().to_str().unwrap().trim_end_matches(".gz");
    let bytes = bytes(path);
    let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap()).unwrap();
    assert_eq!(MeshFormat::sniff(&bytes), Some(format), "{name}");
    read(&bytes, format, &ReadLimits::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn referenced(mesh: &RawMesh) -> usize {
    let mut used = vec![false; mesh.positions.len()];
    for &vertex in mesh.faces.as_flattened().iter().chain(mesh.tetrahedra.as_flattened()) {
        used[vertex as usize] = true;
    }
    used.into_iter().filter(|&used| used).count()
}

/// Indices, values and how many of these make one.
type Layer = fn(&tobj::Mesh) -> (&[u32], &[f64], usize);

#[test]
fn every_mesh_has_its_vertices_and_faces() {
    let Some(folder) = folder() else { return };
    // Vertices in the file, vertices that faces refer to, triangles, tetrahedra.
    let known = [
        ("igea.ply", [134_345, 134_345, 268_686, 0]),
        ("dragon.ply.gz", [437_645, 437_645, 871_414, 0]),
        ("dragon-nonmanifold.ply.gz", [100_250, 100_207, 202_520, 0]),
        ("rolling-stage.obj", [49_988, 49_988, 100_000, 0]),
        ("nefertiti.obj", [49_971, 49_971, 99_938, 0]),
        ("horse.ply", [48_485, 48_485, 96_966, 0]),
        ("armadillo.obj", [43_243, 43_243, 86_482, 0]),
        ("bunny.obj", [35_947, 34_834, 69_451, 0]),
        ("face.obj", [25_905, 25_905, 51_712, 0]),
        ("kitten.obj", [14_472, 14_472, 28_944, 0]),
        ("fertility-14k.obj", [13_971, 13_971, 27_954, 0]),
        ("bumpy-cube.obj", [19_970, 19_970, 39_936, 0]),
        ("camelhead.off", [11_381, 11_381, 22_704, 0]),
        ("rocker-arm.off", [10_044, 10_044, 20_088, 0]),
        ("homer-remeshed-4531.off", [4_531, 4_531, 9_058, 0]),
        ("homer-remeshed-7178.off", [7_178, 7_178, 14_352, 0]),
        ("fertility.off", [4_494, 4_494, 9_000, 0]),
        ("3holes.off", [3_596, 3_596, 7_200, 0]),
        ("fan3.obj", [5, 5, 3, 0]),
        ("hourglass_ico.obj", [23, 23, 40, 0]),
        ("moebius.obj", [280, 280, 448, 0]),
        ("hand-tet.mesh", [7_234, 7_234, 0, 29_998]),
        ("bunny-tet.mesh", [5_433, 5_433, 0, 34_055]),
        ("octopus-tet.mesh", [452, 452, 0, 1_140]),
    ];
    for (name, counts) in known {
        let mesh = load(&folder.join(name));
        let mut found = [mesh.positions.len(), referenced(&mesh), mesh.faces.len(), mesh.tetrahedra.len()];
        // The triangles of a solid are its surface; their number is not the point here.
        if counts[3] > 0 {
            found[2] = 0;
        }
        assert_eq!(found, counts, "{name}");
    }
}

#[test]
fn every_file_of_the_folder_reads() {
    let Some(folder) = folder() else { return };
    let mut files = 0;
    for entry in
        [folder.clone(), folder.join("camel-gallop")].iter().flat_map(|folder| std::fs::read_dir(folder).unwrap())
    {
        let path = entry.unwrap().path();
        if path.is_file() && path.extension().is_some_and(|extension| extension != "md") {
            let mesh = load(&path);
            assert!(mesh.faces.len() + mesh.tetrahedra.len() > 0, "{}", path.display());
            assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()), "{}", path.display());
            files += 1;
        }
    }
    assert!(files >= 30, "{files} files");
}

#[test]
fn seams_of_texture_split_nothing() {
    let Some(folder) = folder() else { return };
    let mesh = load(&folder.join("spot-uv-seams.obj"));
    assert_eq!((mesh.positions.len(), referenced(&mesh), mesh.faces.len()), (2_930, 2_930, 5_856));
    // Closed and of genus 0: every edge has two faces, and V − E + F = 2.
    let mut edges: Vec<(u32, u32)> = mesh.faces.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    let halfedges = edges.len();
    edges.sort_unstable();
    edges.dedup();
    assert_eq!(edges.len(), halfedges);
    assert!(edges.iter().all(|&(a, b)| edges.binary_search(&(b, a)).is_ok()));
    assert_eq!(mesh.positions.len() + mesh.faces.len() - halfedges / 2, 2);
}

#[test]
fn obj_agrees_with_another_reader() {
    let Some(folder) = folder() else { return };
    let mut compared = 0;
    // The quadrilaterals of beast.obj that are no convex polygons are cut differently, by intent.
    for (name, differing) in [("bunny.obj", 0), ("kitten.obj", 0), ("spot-uv-seams.obj", 0), ("beast.obj", 700)] {
        let ours = load(&folder.join(name));
        let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
        let bytes = bytes(&folder.join(name));
        let (models, _) =
            tobj::load_obj_buf(&mut bytes.as_slice(), &options, |_| Err(tobj::LoadError::OpenFileFailed)).unwrap();
        let theirs: Vec<[f64; 3]> = models
            .iter()
            .flat_map(|model| model.mesh.indices.iter().map(|&v| (&model.mesh.positions, 3 * v as usize)))
            .map(|(positions, at)| [positions[at], positions[at + 1], positions[at + 2]])
            .collect();
        assert_eq!(theirs.len(), 3 * ours.faces.len(), "{name}");
        let triangles = ours.faces.iter().map(|face| face.map(|v| ours.positions[v as usize]));
        let different = triangles.zip(theirs.as_chunks().0).filter(|(mine, other)| mine != *other).count();
        assert!(different <= differing, "{name}: {different} triangles differ");

        // Texture coordinates and normals too, corner by corner.
        let Some(own) = ours.attributes.as_ref().map(|own| &own.attributes).filter(|_| differing == 0) else {
            continue;
        };
        let read = |of: Layer| -> Vec<f64> {
            let corners = models.iter().map(|model| of(&model.mesh)).flat_map(|(indices, values, width)| {
                indices.iter().flat_map(move |&v| &values[width * v as usize..width * (v as usize + 1)])
            });
            corners.copied().collect()
        };
        if let Some(layer) = &own.texture {
            let mine: Vec<f64> =
                layer.corners.iter().flatten().flat_map(|&index| layer.values[index as usize]).collect();
            assert_eq!(mine, read(|mesh| (&mesh.texcoord_indices, &mesh.texcoords, 2)), "{name}");
            compared += 1;
        }
        if let Some(layer) = &own.normals {
            let mine: Vec<f64> =
                layer.corners.iter().flatten().flat_map(|&index| layer.values[index as usize]).collect();
            assert_eq!(mine, read(|mesh| (&mesh.normal_indices, &mesh.normals, 3)), "{name}");
            compared += 1;
        }
    }
    assert!(compared >= 2, "{compared} layers");
}

#[test]
fn a_file_with_seams_comes_back_with_them() {
    let Some(folder) = folder() else { return };
    let raw = load(&folder.join("spot-uv-seams.obj"));
    let checked = crate::check::check(raw, &Default::default()).unwrap();
    let attributes = checked.attributes.unwrap();
    let layer = attributes.texture.as_ref().unwrap();
    let mut pairs: Vec<(u32, u32)> =
        checked.mesh.faces.as_flattened().iter().copied().zip(layer.corners.as_flattened().iter().copied()).collect();
    pairs.sort_unstable();
    pairs.dedup();
    assert_eq!(
        (checked.mesh.positions.len(), pairs.len()),
        (2_930, 3_225),
        "vertices, and what seams would split them into"
    );
    let mut obj = Vec::new();
    write::write_obj_with(&checked.mesh, &attributes, &mut obj).unwrap();
    let back = read(&obj, MeshFormat::Obj, &ReadLimits::default()).unwrap();
    assert_eq!((back.positions, back.faces), (checked.mesh.positions, checked.mesh.faces));
    assert_eq!(back.attributes.unwrap().attributes, attributes);
}

#[test]
fn what_is_written_reads_back_to_the_last_bit() {
    let Some(folder) = folder() else { return };
    for name in ["rocker-arm.off", "elephant.obj"] {
        let raw = RawMesh { attributes: None, ..load(&folder.join(name)) };
        let mesh = TriangleMesh { positions: raw.positions.clone(), faces: raw.faces.clone(), ..Default::default() };
        let (mut obj, mut ply) = (Vec::new(), Vec::new());
        write::write_obj(&mesh, &mut obj).unwrap();
        write::write_ply(&mesh, None, &mut ply).unwrap();
        assert_eq!(read(&obj, MeshFormat::Obj, &ReadLimits::default()).unwrap(), raw);
        assert_eq!(read(&ply, MeshFormat::Ply, &ReadLimits::default()).unwrap(), raw);
    }
}
