#!/usr/bin/env python3
"""Inputs for fuzz targets to begin with: a small valid one of each kind. seeds.py FOLDER makes FOLDER/TARGET/… for every target but `bodies`, which writes its
own. Needs NumPy; with CHLADNI_BINARY also products are made."""

import base64
import io
import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np

VERTICES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
FACES = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
TETRAHEDRA = [(0, 2, 4, 5), (2, 1, 4, 5), (1, 3, 4, 5), (3, 0, 4, 5)]


def lines(rows, before="", first=0):
    return "".join(before + " ".join(str(x + first) for x in row) + "\n" for row in rows)


def npz(**arrays):
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


OFF = "OFF\n6 8 0\n" + lines(VERTICES) + lines(FACES, "3 ")
MARKET = "%%MatrixMarket matrix coordinate real symmetric\n5 5 9\n1 1 1\n2 2 2\n3 3 2\n4 4 2\n5 5 1\n2 1 -1\n3 2 -1\n4 3 -1\n5 4 -1\n"
MASS = "%%MatrixMarket matrix coordinate real general\n5 5 7\n1 1 2\n2 2 2\n3 3 2\n4 4 2\n5 5 2\n1 2 0.5\n2 1 0.5\n"


def meshes():
    v, f, t = (np.array(rows) for rows in (VERTICES, FACES, TETRAHEDRA))
    yield "off", OFF
    yield "off", "COFF\n6 2 0\n" + "".join(f"{x} {y} {z} 255 0 0 255\n" for x, y, z in VERTICES) + "4 0 2 1 3\n3 0 2 4 1 0 0\n"
    yield "obj", "# a\no a\n" + lines(VERTICES, "v ") + "vt 0 1\nvn 0 0 1\n" + lines(FACES, "f ", 1) + "f 1/1/1 2/1/1 -1//1\nl 1 2\n"
    head = "ply\nformat {} 1.0\ncomment a\nelement vertex 6\nproperty {} x\nproperty {} y\nproperty {} z\nelement face 8\nproperty list uchar int vertex_indices\nend_header\n"
    yield "ply", head.format("ascii", *["float"] * 3) + lines(VERTICES) + lines(FACES, "3 ")
    for order, name in (("<", "little"), (">", "big")):
        body = v.astype(order + "f8").tobytes() + b"".join(struct.pack(order + "Biii", 3, *face) for face in FACES)
        yield "ply", head.format(f"binary_{name}_endian", *["double"] * 3).encode() + body
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    yield "stl", "solid a\n" + "".join(facet.format(lines([VERTICES[i] for i in face], "vertex ")) for face in FACES) + "endsolid a\n"
    yield "stl", bytes(80) + struct.pack("<I", 8) + b"".join(struct.pack("<12fH", 0, 0, 1, *v[list(face)].ravel(), 0) for face in FACES)
    yield "medit", (
        "MeshVersionFormatted 2\nDimension 3\nVertices\n6\n" + "".join(f"{x} {y} {z} 0\n" for x, y, z in VERTICES)
        + "Triangles\n8\n" + "".join(f"{a + 1} {b + 1} {c + 1} 0\n" for a, b, c in FACES)
        + "Tetrahedra\n4\n" + "".join(f"{' '.join(str(i + 1) for i in tet)} 1\n" for tet in TETRAHEDRA) + "End\n"
    )
    vtk = "# vtk DataFile Version 3.0\na\n{}\nDATASET {}\n"
    yield "vtk", vtk.format("ASCII", "POLYDATA") + "POINTS 6 float\n" + lines(VERTICES) + "POLYGONS 8 32\n" + lines(FACES, "3 ")
    binary = b"POINTS 6 double\n" + v.astype(">f8").tobytes() + b"\nPOLYGONS 8 32\n" + np.insert(f, 0, 3, 1).astype(">i4").tobytes() + b"\n"
    yield "vtk", vtk.format("BINARY", "POLYDATA").encode() + binary
    grid = "POINTS 6 float\n" + lines(VERTICES) + "CELLS 4 20\n" + lines(TETRAHEDRA, "4 ") + "CELL_TYPES 4\n10\n10\n10\n10\n"
    yield "vtk", vtk.format("ASCII", "UNSTRUCTURED_GRID") + grid
    array = '<DataArray type="{}" Name="{}" NumberOfComponents="{}" format="{}">{}</DataArray>'
    def in_xml(encode, form):
        points = array.format("Float64", "Points", 3, form, encode(v.astype("<f8")))
        corners = array.format("Int32", "connectivity", 1, form, encode(f.astype("<i4")))
        offsets = array.format("Int64", "offsets", 1, form, encode(np.arange(3, 25, 3, dtype="<i8")))
        kinds = array.format("UInt8", "types", 1, form, encode(np.full(8, 5, dtype="u1")))
        piece = f'<Points>{points}</Points><Cells>{corners}{offsets}{kinds}</Cells>'
        compressor = ' compressor="vtkZLibDataCompressor"' if encode is folded else ""
        return f'<VTKFile type="UnstructuredGrid"{compressor}><UnstructuredGrid><Piece NumberOfPoints="6" NumberOfCells="8">{piece}</Piece></UnstructuredGrid></VTKFile>'
    def folded(values):
        block = zlib.compress(values.tobytes())
        return (base64.b64encode(struct.pack("<4I", 1, 1 << 15, values.nbytes, len(block))) + base64.b64encode(block)).decode()
    yield "vtk", in_xml(lambda values: " ".join(map(str, values.ravel())), "ascii")
    yield "vtk", in_xml(folded, "binary")
    nodes = "".join(f"{i + 1} {x} {y} {z}\n" for i, (x, y, z) in enumerate(VERTICES))
    elements = "".join(f"{i + 1} 2 2 1 1 {a + 1} {b + 1} {c + 1}\n" for i, (a, b, c) in enumerate(FACES))
    yield "gmsh", f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n{nodes}$EndNodes\n$Elements\n8\n{elements}$EndElements\n"
    nodes = "1 6 1 6\n2 1 0 6\n" + "".join(f"{i + 1}\n" for i in range(6)) + lines(VERTICES)
    elements = "1 8 1 8\n2 1 2 8\n" + "".join(f"{i + 1} {a + 1} {b + 1} {c + 1}\n" for i, (a, b, c) in enumerate(FACES))
    yield "gmsh", f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n{nodes}$EndNodes\n$Elements\n{elements}$EndElements\n"
    nodes = struct.pack("<4Q3iQ6Q", 1, 6, 1, 6, 2, 1, 0, 6, *range(1, 7)) + v.astype("<f8").tobytes()
    elements = struct.pack("<4Q3iQ", 1, 8, 1, 8, 2, 1, 2, 8) + np.insert(f + 1, 0, np.arange(1, 9), 1).astype("<u8").tobytes()
    yield "gmsh", b"$MeshFormat\n4.1 1 8\n\1\0\0\0\n$EndMeshFormat\n$Nodes\n" + nodes + b"\n$EndNodes\n$Elements\n" + elements + b"\n$EndElements\n"
    yield "freesurfer", b"\xff\xff\xfecreated\n\n" + struct.pack(">ii", 6, 8) + v.astype(">f4").tobytes() + f.astype(">i4").tobytes()
    yield "npz", npz(vertices=v.astype("<f8"), faces=f.astype("<u4"))
    yield "npz", npz(vertices=v.astype("<f4"), faces=f.astype("<i8"), tetrahedra=t.astype("<i4"))
    yield "json", json.dumps({"vertices": VERTICES, "faces": FACES})
    yield "json", json.dumps({"vertices": VERTICES, "tetrahedra": TETRAHEDRA})
    positions, corners = v.astype("<f4").tobytes(), f.astype("<u2").tobytes()
    yield "gltf", json.dumps({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 120, "uri": "data:application/octet-stream;base64," + base64.b64encode(positions + corners).decode()}],
        "bufferViews": [{"buffer": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 48}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3", "min": [-1, -1, -1], "max": [1, 1, 1]},
                      {"bufferView": 1, "componentType": 5123, "count": 24, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0, "translation": [1, 0, 0]}],
        "scenes": [{"nodes": [0]}],
    })
    array = '<DataArray Intent="NIFTI_INTENT_{}" DataType="NIFTI_TYPE_{}" ArrayIndexingOrder="RowMajorOrder" Dimensionality="2" Encoding="ASCII" Dim0="{}" Dim1="3"><Data>{}</Data></DataArray>'
    arrays = array.format("POINTSET", "FLOAT32", 6, lines(VERTICES)) + array.format("TRIANGLE", "INT32", 8, lines(FACES))
    yield "gifti", f'<?xml version="1.0"?><GIFTI Version="1.0" NumberOfDataArrays="2">{arrays}</GIFTI>'


# In the order of KINDS.
JOBS = [
    ("eigenbasis", [{"count": 3}, {"count": 3, "method": "hsim", "precision": "f64"}, {"method": "hsim", "below": 5.0, "at_most": 5},
                    {"method": "hsim", "count": 2, "operator": "hodge"}, {"method": "hsim", "count": 2, "operator": "graph"},
                    {"count": 3, "boundary": "dirichlet", "operator": {"hamiltonian": {"potential": [0, 1, 2, 3, 4, 5]}}},
                    {"count": 3, "operator": {"anisotropic": {"alpha": 2.0}}}]),
    ("field_basis", [{"dimension": 6}, {"field": "n_vector", "n": 4, "dimension": 4}]),
    ("operator_family", [{"dimension": 5}]),
    ("vibration_basis", [{"count": 2, "thickness": 0.01}, {"count": 2, "thickness": 0.01, "method": "approximate"}]),
    ("pencil_basis", [{"count": 2}, {"below": 1.0}, {"around": 1.5, "count": 2}, {"between": [0.1, 2.0], "fixed": [0]}]),
    ("map_collection", [{"pairs": 40, "start": 20}, {"step": 10, "samples": 400, "oriented": False, "polish": False}]),
]


def others():
    for kind, (_, all_parameters) in enumerate(JOBS):
        for parameters in all_parameters:
            text = json.dumps(parameters).encode()
            yield "parameters", text
            yield "jobs", bytes([kind]) + text + b"\0" + OFF.encode()
            if kind == 4:
                yield "problems", text + b"\0" + MARKET.encode()
                yield "problems", text + b"\0" + MARKET.encode() + b"\0mass\0" + MASS.encode()
    yield "requests", json.dumps({"columns": 1, "values": [1, 2.5, None]})
    yield "requests", json.dumps({"constraints": [{"face": 1, "angle": 0.5}], "smoothness": 1.0})
    yield "matrices", MARKET
    yield "matrices", MASS
    yield "matrices", "%%MatrixMarket matrix array real general\n5 1\n1\n2\n3\n4\n5\n"
    out = io.BytesIO()
    np.save(out, np.arange(1.0, 6.0))
    yield "matrices", out.getvalue()
    three = {"data": np.array([1.0, 2, 3]), "indices": np.array([0, 1, 2], "<i4"), "indptr": np.array([0, 1, 2, 3], "<i4"), "shape": np.array([3, 3])}
    yield "matrices", npz(format=np.array(b"csr"), **three)
    yield "matrices", npz(**three, mass=np.ones(3))


def products(folder):
    """What the program writes of each kind."""
    binary = os.environ.get("CHLADNI_BINARY")
    if not binary:
        return
    mesh = folder / "octahedron.off"
    mesh.write_text(OFF)
    for number, options in enumerate([[], ["--storage", "dense"], ["--method", "hsim", "--precision", "f64"]]):
        out = folder / "products" / f"seed-{number}"
        subprocess.run([binary, "solve", mesh, "--count", "3", *options, "--output", out.with_suffix(".npz")], check=False, stdout=subprocess.DEVNULL)
    mesh.unlink()


def main():
    folder = Path(sys.argv[1])
    for number, (target, content) in enumerate([*meshes(), *others()]):
        (folder / target).mkdir(parents=True, exist_ok=True)
        (folder / target / f"seed-{number}").write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / "products").mkdir(parents=True, exist_ok=True)
    products(folder)


main()
