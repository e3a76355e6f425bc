//! Reading meshes from untrusted bytes: one file per format.
//!
//! | format | file | notes |
//! |---|---|---|
//! | Wavefront OBJ | `obj` | `v` lines are the identity of vertices; texture coordinates, normals and names are kept; materials are never opened |
//! | Stanford PLY | `ply` | ASCII and both byte orders, polygons, triangle strips, extra elements |
//! | Geomview OFF | `off`, `off_binary` | ASCII and binary, with the `ST`, `C`, `N`, `4` and `n` prefixes |
//! | STL | `stl` | ASCII and binary; positions are repeated by design |
//! | MEDIT `.mesh`, `.meshb` | `medit`, `medit_binary` | ASCII and binary; triangles, quadrilaterals, tetrahedra |
//! | VTK legacy | `vtk` | ASCII and binary; polygonal data and unstructured grids |
//! | VTK in XML (`.vtp`, `.vtu`) | `vtk_xml` | all encodings, with zlib or without; all pieces |
//! | Gmsh MSH | `gmsh` | ASCII and binary, versions 2 and 4.1; triangles, quadrilaterals, tetrahedra |
//! | FreeSurfer | `freesurfer` | triangle surfaces |
//! | glTF 2.0 | `gltf` | GLB, or JSON with its buffers inside; all nodes |
//! | GIFTI | `gifti` | surfaces in all encodings but other files |
//! | arrays | `arrays` | `vertices`, `faces`, `tetrahedra` as NPZ, deflated or not, or as JSON |
//!
//! Every reader takes a byte slice, is linear in its length, allocates in proportion to the bytes that are really there
//! (never to a count that a header claims), and answers with a [`RawMesh`] or a [`ReadError`] that names the offender.

mod arrays;
mod builder;
mod error;
mod freesurfer;
mod gifti;
mod gltf;
mod gltf_nodes;
mod gmsh;
mod gmsh_source;
mod medit;
mod medit_binary;
mod obj;
mod obj_attributes;
mod off;
mod off_binary;
mod off_keyword;
mod ply;
mod polygon;
mod stl;
mod text;
mod vtk;
mod vtk_arrays;
mod vtk_xml;
mod xml;

use serde::{Deserialize, Serialize};

use super::attributes::Attributes;

pub use error::{FileLocation, ReadError};

/// What a reader found, before anything is checked: indices are in range, nothing else is promised.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawMesh {
    /// Vertex positions as written, in the order of the file; they may be non-finite.
    pub positions: Vec<[f64; 3]>,
    /// Triangles; polygons and strips have been triangulated. A face may repeat a vertex.
    pub faces: Vec<[u32; 3]>,
    /// Which face of the file each triangle is or is a part of, where a polygon of more than three corners was
    /// triangulated or a face left out; `None` where triangles and faces are the same.
    pub polygons: Option<Polygons>,
    /// Tetrahedra, for the formats that have them.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Polygons of more than three corners that were triangulated.
    pub polygons_triangulated: usize,
    /// Faces of no, one or two corners. They have no area, so they were left out.
    pub short_faces_dropped: usize,
    /// Whether the format repeats positions by design (STL, glTF), so that equal positions have to be merged.
    pub splits_vertices: bool,
    /// Texture coordinates, normals and names of an OBJ, for the corners and faces of `faces`.
    pub attributes: Option<Box<RawAttributes>>,
}

/// What a reader found beside positions and faces.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawAttributes {
    /// What is there.
    pub attributes: Attributes,
    /// Corners that name a texture coordinate or a normal which is not there, or not finite; they have none.
    pub missing: usize,
}

/// Which face of a file each triangle belongs to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Polygons {
    /// For each triangle its face, numbered from 0 in the order of the file.
    pub of_triangle: Vec<u32>,
    /// Faces of the file, those that were left out among them.
    pub count: usize,
}

/// The formats that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Stanford PLY.
    Ply,
    /// Geomview OFF.
    Off,
    /// Stereolithography, ASCII or binary.
    Stl,
    /// MEDIT (INRIA): `.mesh`, ASCII, or `.meshb`, binary.
    Medit,
    /// VTK: its legacy format, or XML (`.vtp`, `.vtu`).
    Vtk,
    /// Gmsh's MSH, ASCII or binary.
    Gmsh,
    /// A triangle surface of FreeSurfer.
    #[serde(rename = "freesurfer")]
    FreeSurfer,
    /// glTF 2.0, binary or JSON.
    Gltf,
    /// A GIFTI surface.
    Gifti,
    /// Arrays `vertices`, `faces` and `tetrahedra` in an NPZ file, as `numpy.savez` and `numpy.savez_compressed` write
    /// them.
    Npz,
    /// The same as a JSON object.
    Json,
}

impl MeshFormat {
    /// Every format, in the order in which documentation lists them.
    pub const ALL: [MeshFormat; 12] = [
        MeshFormat::Obj,
        MeshFormat::Ply,
        MeshFormat::Off,
        MeshFormat::Stl,
        MeshFormat::Medit,
        MeshFormat::Vtk,
        MeshFormat::Gmsh,
        MeshFormat::FreeSurfer,
        MeshFormat::Gltf,
        MeshFormat::Gifti,
        MeshFormat::Npz,
        MeshFormat::Json,
    ];

    /// The name on the wire and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            MeshFormat::Obj => "obj",
            MeshFormat::Ply => "ply",
            MeshFormat::Off => "off",
            MeshFormat::Stl => "stl",
            MeshFormat::Medit => "medit",
            MeshFormat::Vtk => "vtk",
            MeshFormat::Gmsh => "gmsh",
            MeshFormat::FreeSurfer => "freesurfer",
            MeshFormat::Gltf => "gltf",
            MeshFormat::Gifti => "gifti",
            MeshFormat::Npz => "npz",
            MeshFormat::Json => "json",
        }
    }

    /// The media type to answer with. Only `model/obj`, `model/stl` and `model/gltf-binary` are registered with IANA.
    pub fn media_type(self) -> &'static str {
        match self {
            MeshFormat::Obj => "model/obj",
            MeshFormat::Ply => "model/ply",
            MeshFormat::Off => "model/off",
            MeshFormat::Stl => "model/stl",
            MeshFormat::Medit => "model/x-medit",
            MeshFormat::Vtk => "model/x-vtk",
            MeshFormat::Gmsh => "model/x-gmsh",
            MeshFormat::FreeSurfer => "model/x-freesurfer",
            MeshFormat::Gltf => "model/gltf-binary",
            MeshFormat::Gifti => "model/x-gifti",
            MeshFormat::Npz => "application/x-npz",
            MeshFormat::Json => "application/json",
        }
    }

    /// The format of a file extension, with or without the dot and in any case; [`MeshFormat::name`] is understood too.
    pub fn from_extension(extension: &str) -> Option<Self> {
        match extension.trim_start_matches('.').to_ascii_lowercase().as_str() {
            "obj" => Some(MeshFormat::Obj),
            "ply" => Some(MeshFormat::Ply),
            "off" | "coff" | "noff" => Some(MeshFormat::Off),
            "stl" => Some(MeshFormat::Stl),
            "mesh" | "meshb" | "medit" => Some(MeshFormat::Medit),
            "vtk" | "vtp" | "vtu" => Some(MeshFormat::Vtk),
            "msh" | "gmsh" => Some(MeshFormat::Gmsh),
            // FreeSurfer's files end in what the surface is.
            "freesurfer" | "fsurf" | "surf" | "pial" | "white" | "orig" | "smoothwm" | "inflated" | "sphere" => {
                Some(MeshFormat::FreeSurfer)
            }
            "gltf" | "glb" => Some(MeshFormat::Gltf),
            "gifti" | "gii" => Some(MeshFormat::Gifti),
            "npz" => Some(MeshFormat::Npz),
            "json" => Some(MeshFormat::Json),
            _ => None,
        }
    }

    /// The format of a media type in any case; parameters after `;` are ignored. General types (`text/plain`,
    /// `application/octet-stream`) are no format: see [`MeshFormat::sniff`].
    pub fn from_media_type(media_type: &str) -> Option<Self> {
        let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        match essence.as_str() {
            "model/obj" | "model/x-obj" | "application/obj" | "application/x-obj" | "application/wavefront-obj" => {
                Some(MeshFormat::Obj)
            }
            "model/ply" | "model/x-ply" | "application/ply" | "application/x-ply" => Some(MeshFormat::Ply),
            "model/off" | "model/x-off" | "application/off" | "application/x-off" => Some(MeshFormat::Off),
            "model/stl"
            | "model/x-stl"
            | "model/x.stl-ascii"
            | "model/x.stl-binary"
            | "application/sla"
            | "application/stl"
            | "application/x-stl"
            | "application/vnd.ms-pki.stl" => Some(MeshFormat::Stl),
            "model/medit" | "model/x-medit" | "application/x-medit" => Some(MeshFormat::Medit),
            "model/vtk" | "model/x-vtk" | "application/x-vtk" => Some(MeshFormat::Vtk),
            "model/gmsh" | "model/x-gmsh" | "application/x-gmsh" => Some(MeshFormat::Gmsh),
            "model/x-freesurfer" | "application/x-freesurfer" => Some(MeshFormat::FreeSurfer),
            "model/gltf-binary" | "model/gltf+json" => Some(MeshFormat::Gltf),
            "model/x-gifti" | "application/x-gifti" => Some(MeshFormat::Gifti),
            "application/x-npz" => Some(MeshFormat::Npz),
            "application/json" => Some(MeshFormat::Json),
            _ => None,
        }
    }

    /// Guesses the format from the first bytes (and, for binary STL, the length) of a whole file.
    pub fn sniff(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Some(MeshFormat::Ply);
        }
        if bytes.starts_with(b"PK\x03\x04") {
            return Some(MeshFormat::Npz);
        }
        if bytes.starts_with(gltf::MAGIC) {
            return Some(MeshFormat::Gltf);
        }
        if bytes.starts_with(freesurfer::MAGIC) {
            return Some(MeshFormat::FreeSurfer);
        }
        if bytes.starts_with(vtk::SIGNATURE) {
            return Some(MeshFormat::Vtk);
        }
        if stl::is_binary_by_size(bytes) {
            return Some(MeshFormat::Stl);
        }
        if medit_binary::is_binary(bytes) {
            return Some(MeshFormat::Medit);
        }
        let mut text = text::Text::new(bytes);
        if !text.any() {
            return None;
        }
        match text.token() {
            word if word.starts_with(b"{") && gltf::is_json(bytes) => Some(MeshFormat::Gltf),
            word if word.starts_with(b"<") && gifti::is_xml(bytes) => Some(MeshFormat::Gifti),
            word if word.starts_with(b"<") && vtk_xml::is_xml(bytes) => Some(MeshFormat::Vtk),
            word if word.starts_with(b"{") => Some(MeshFormat::Json),
            b"solid" => Some(MeshFormat::Stl),
            b"$MeshFormat" => Some(MeshFormat::Gmsh),
            b"MeshVersionFormatted" => Some(MeshFormat::Medit),
            b"v" | b"vt" | b"vn" | b"vp" | b"f" | b"fo" | b"o" | b"g" | b"s" | b"mtllib" | b"usemtl" => {
                Some(MeshFormat::Obj)
            }
            word if off_keyword::Variant::from_keyword(word).is_some() => Some(MeshFormat::Off),
            _ => None,
        }
    }
}

impl std::fmt::Display for MeshFormat {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(match self {
            MeshFormat::Obj => "OBJ",
            MeshFormat::Ply => "PLY",
            MeshFormat::Off => "OFF",
            MeshFormat::Stl => "STL",
            MeshFormat::Medit => "MEDIT",
            MeshFormat::Vtk => "VTK",
            MeshFormat::Gmsh => "Gmsh",
            MeshFormat::FreeSurfer => "FreeSurfer",
            MeshFormat::Gltf => "glTF",
            MeshFormat::Gifti => "GIFTI",
            MeshFormat::Npz => "NPZ",
            MeshFormat::Json => "JSON",
        })
    }
}

/// How much a file may hold. Each limit is its own [`ReadError`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadLimits {
    /// Vertices (for STL, three per facet). Values above `u32::MAX` mean `u32::MAX`.
    pub vertices: usize,
    /// Triangles, after polygons were triangulated. Values above `u32::MAX` mean `u32::MAX`.
    pub faces: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
    /// Corners of one polygon. A fan of more makes one vertex the neighbour of all others, which nothing later can use.
    pub corners_per_polygon: usize,
    /// Groups and objects of an OBJ, solids of an ASCII STL, elements and properties of a PLY, sections of a MEDIT
    /// file.
    pub groups: usize,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self {
            vertices: 50_000_000,
            faces: 100_000_000,
            tetrahedra: 200_000_000,
            corners_per_polygon: 65_536,
            groups: 1_000_000,
        }
    }
}

/// Reads a whole file that is in memory. Vertices keep the order of the file, faces too.
///
/// Fails with the first [`ReadError`] in the order of the file. Time and memory are linear in `bytes.len()`.
pub fn read(bytes: &[u8], format: MeshFormat, limits: &ReadLimits) -> Result<RawMesh, ReadError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ReadError::Empty);
    }
    let mesh = match format {
        MeshFormat::Obj => obj::read(bytes, limits),
        MeshFormat::Ply => ply::read(bytes, limits),
        MeshFormat::Off => off::read(bytes, limits),
        MeshFormat::Stl => stl::read(bytes, limits),
        MeshFormat::Medit if medit_binary::is_binary(bytes) => medit_binary::read(bytes, limits),
        MeshFormat::Medit => medit::read(bytes, limits),
        MeshFormat::Vtk if vtk_xml::is_xml(bytes) => vtk_xml::read(bytes, limits),
        MeshFormat::Vtk => vtk::read(bytes, limits),
        MeshFormat::Gmsh => gmsh::read(bytes, limits),
        MeshFormat::FreeSurfer => freesurfer::read(bytes, limits),
        MeshFormat::Gltf => gltf::read(bytes, limits),
        MeshFormat::Gifti => gifti::read(bytes, limits),
        MeshFormat::Npz => arrays::read_npz(bytes, limits),
        MeshFormat::Json => arrays::read_json(bytes, limits),
    }?;
    if mesh.positions.is_empty() {
        return Err(ReadError::NoVertices);
    }
    Ok(mesh)
}

/// The bytes that a text in base64 stands for, blanks passed over; `None` where it is none.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    use base64::Engine;
    let text: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect();
    base64::engine::general_purpose::STANDARD.decode(text).ok()
}

#[cfg(test)]
mod real_meshes;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_extensions_and_media_types_lead_back_to_the_format() {
        for format in MeshFormat::ALL {
            assert_eq!(MeshFormat::from_extension(format.name()), Some(format));
            assert_eq!(MeshFormat::from_media_type(format.media_type()), Some(format));
            assert_eq!(serde_json::to_value(format).unwrap(), format.name());
        }
        assert_eq!(MeshFormat::from_extension(".MESH"), Some(MeshFormat::Medit));
        assert_eq!(MeshFormat::from_media_type(" Model/PLY ; charset=utf-8"), Some(MeshFormat::Ply));
        assert_eq!(MeshFormat::from_media_type("text/plain"), None);
        assert_eq!(MeshFormat::from_extension("glb"), Some(MeshFormat::Gltf));
        assert_eq!(MeshFormat::from_extension(".gii"), Some(MeshFormat::Gifti));
        assert_eq!(MeshFormat::from_extension("step"), None);
    }

    #[test]
    fn the_first_words_tell_the_format() {
        let cases: [(&[u8], Option<MeshFormat>); 17] = [
            (b"PK\x03\x04\x14\0", Some(MeshFormat::Npz)),
            (b" {\"vertices\": []}", Some(MeshFormat::Json)),
            (b"ply\r\nformat ascii 1.0\r\n", Some(MeshFormat::Ply)),
            (b"# made by hand\n\nv 0 0 0\n", Some(MeshFormat::Obj)),
            (b"\xef\xbb\xbfmtllib a.mtl\n", Some(MeshFormat::Obj)),
            (b"# hello\nOFF\n3 1 0\n", Some(MeshFormat::Off)),
            (b"STCN4OFF 3 1 0\n", Some(MeshFormat::Off)),
            (b"solid cube\nfacet normal 0 0 1\n", Some(MeshFormat::Stl)),
            (b"MeshVersionFormatted 2\n", Some(MeshFormat::Medit)),
            (b"glTF\x02\0\0\0", Some(MeshFormat::Gltf)),
            (b"{\"asset\": {\"version\": \"2.0\"}}", Some(MeshFormat::Gltf)),
            (b"<?xml version=\"1.0\"?>\n<GIFTI>", Some(MeshFormat::Gifti)),
            (b"<VTKFile type=\"PolyData\">", Some(MeshFormat::Vtk)),
            (b"<html>", None),
            (b"plywood", None),
            (b"", None),
            (b"\0\0\0\0", None),
        ];
        for (bytes, format) in cases {
            assert_eq!(MeshFormat::sniff(bytes), format, "{}", String::from_utf8_lossy(bytes));
        }
    }

    #[test]
    fn blank_files_are_empty_in_every_format() {
        for format in MeshFormat::ALL {
            for bytes in [b"".as_slice(), b" \r\n\t\n"] {
                assert_eq!(read(bytes, format, &ReadLimits::default()), Err(ReadError::Empty));
            }
        }
    }
}
