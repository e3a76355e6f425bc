"""What is taken for a mesh, and what is refused and how."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import chladni

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def spectrum(vertices, faces=None):
    return chladni.eigs(vertices, faces, k=5, method="hsim").values


@pytest.fixture(scope="module")
def expected(knot):
    return spectrum(knot)


def variants(knot):
    vertices, faces = knot.vertices, knot.faces
    frozen = vertices.copy(), faces.copy()
    for array in frozen:
        array.flags.writeable = False
    spaced = np.zeros((2 * len(vertices), 6))
    spaced[::2, ::2] = vertices
    yield "Fortran order", np.asfortranarray(vertices), np.asfortranarray(faces)
    yield "strided", spaced[::2, ::2], np.repeat(faces, 2, axis=0)[::2]
    yield "backwards", vertices[::-1][::-1], faces[::-1]
    yield "read-only", *frozen
    yield "lists", vertices.tolist(), faces.tolist()
    yield "big-endian", vertices.astype(">f8"), faces.astype(">i4")
    for dtype in (np.int32, np.uint32, np.uint64, np.int16):
        yield str(dtype), vertices, faces.astype(dtype)


def test_arrays_of_every_layout_and_type(knot, expected):
    for name, vertices, faces in variants(knot):
        assert np.allclose(spectrum(vertices, faces), expected, atol=1e-9), name
    single = spectrum(knot.vertices.astype(np.float32), knot.faces)
    assert np.allclose(single, expected, rtol=1e-4, atol=1e-6)


def test_arrays_that_were_passed_are_not_changed(knot):
    vertices, faces = knot.vertices.copy(), knot.faces.copy()
    chladni.eigs(vertices, faces, k=5)
    assert np.array_equal(vertices, knot.vertices) and np.array_equal(faces, knot.faces)


def test_meshes_of_other_libraries_by_their_looks(knot, expected):
    v, f = knot.vertices, knot.faces
    padded = np.column_stack([np.full(len(f), 3), f]).ravel()
    for mesh in [
        SimpleNamespace(vertices=v, faces=f),
        SimpleNamespace(points=v, faces=padded),
        SimpleNamespace(points=v, cells_dict={"triangle": f, "line": f[:, :2]}),
        SimpleNamespace(points=v, cells_dict={np.uint8(3): f[:, :2], np.uint8(5): f}),
        SimpleNamespace(vertices=v, triangles=f),
        (v, f),
    ]:
        assert np.allclose(spectrum(mesh), expected, atol=1e-9)
    for broken in [SimpleNamespace(points=v, cells_dict={"quad": f}), SimpleNamespace(points=v, cells_dict={np.uint8(9): f}), SimpleNamespace(points=v, faces=padded[:-1]), object(), v]:
        with pytest.raises(chladni.ParameterError):
            chladni.Mesh(broken)


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "message"),
    [
        (SQUARE, [[0, 1, 2], [0, 2, 7]], chladni.MeshError, "face 1 refers to vertex 7 of 4"),
        (SQUARE, [[0, 1, 2], [0, -1, 3]], chladni.MeshError, "face 1 refers to vertex -1 of 4"),
        (SQUARE, np.array([[0, 1, 2**40]]), chladni.MeshError, "face 0 refers to vertex 1099511627776 of 4"),
        (np.where(SQUARE == 1, np.nan, SQUARE), TWO, chladni.MeshError, "vertex 1 is not finite, and face 0 uses it"),
        (SQUARE * 1e200, TWO, chladni.MeshError, "beyond 1e30"),
        (SQUARE * 0, TWO, chladni.MeshError, "area"),
        (SQUARE, [[0, 0, 1]], chladni.MeshError, "no faces"),
        (SQUARE[:3], np.empty((0, 3), int), chladni.MeshError, "a surface needs 4"),
        (SQUARE, TWO.astype(float), chladni.ParameterError, "faces must be integers, got dtype float64"),
        (SQUARE, TWO == 1, chladni.ParameterError, "faces must be integers, got dtype bool"),
        (SQUARE, [[0, 1, 2, 3]], chladni.ParameterError, r"faces must have shape \(f, 3\), got \(1, 4\)"),
        (SQUARE, [0, 1, 2], chladni.ParameterError, r"faces must have shape \(f, 3\), got \(3,\)"),
        (SQUARE.ravel(), TWO, chladni.ParameterError, r"vertices must have shape \(n, 3\), got \(12,\)"),
        (SQUARE * 1j, TWO, chladni.ParameterError, "vertices must be real numbers, got dtype complex128"),
        ([["a", "b", "c"]], TWO, chladni.ParameterError, "vertices must be real numbers, got dtype"),
        ([[0, 1], [0]], TWO, chladni.ParameterError, "vertices must be an array"),
    ],
)
def test_refusals_name_the_offender(vertices, faces, error, message):
    with pytest.raises(error, match=message) as caught:
        chladni.Mesh(vertices, faces)
    assert isinstance(caught.value, ValueError)
    assert caught.value.code in str(caught.value.code) and caught.value.code != "error"


def with_strays(mesh):
    """The mesh with a vertex that no face uses before each thousandth, and where its vertices are then."""
    at = np.arange(len(mesh.vertices)) + np.arange(len(mesh.vertices)) // 1000 + 1
    vertices = np.full((at[-1] + 2, 3), 9.0)
    vertices[at] = mesh.vertices
    return vertices, at[mesh.faces], at


def test_answers_are_numbered_as_the_arrays(knot, knot_basis):
    vertices, faces, at = with_strays(knot)
    mesh = chladni.Mesh(vertices, faces)
    assert np.array_equal(mesh.vertices, vertices) and np.array_equal(mesh.faces, faces)
    assert len(mesh.kept_vertices) == len(knot.vertices) and np.array_equal(mesh.vertex_map[at], np.arange(len(at)))
    stray = np.setdiff1d(np.arange(len(vertices)), at)
    assert (mesh.vertex_map[stray] == -1).all()
    basis = chladni.eigs(mesh, k=40, method="hsim")
    assert np.array_equal(basis.vectors[at], knot_basis.vectors) and np.isnan(basis.vectors[stray]).all()
    assert np.isfinite(basis.lift(3, 5, extend="nearest")).all()
    assert np.array_equal(basis.mass[at], knot_basis.mass) and (basis.mass[stray] == 0).all()
    assert np.array_equal(basis.signatures("wks")[at], knot_basis.signatures("wks"))
    assert np.array_equal(basis.signatures("wks", vertices=at[[5, 7]]), knot_basis.signatures("wks", vertices=[5, 7]))
    assert np.array_equal(basis.distances(at[11])[at], knot_basis.distances(11))
    assert np.array_equal(mesh.geodesics(at[11])[at], knot.geodesics(11))
    function = np.sin(vertices[:, 0])
    function[stray] = np.nan
    assert np.allclose(basis.project(function), knot_basis.project(np.sin(knot.vertices[:, 0])))
    assert np.allclose(basis.filter(function, "heat", time=0.1)[at], knot_basis.filter(np.sin(knot.vertices[:, 0]), "heat", time=0.1))
    with pytest.raises(chladni.ParameterError, match=f"vertex {stray[0]} of the file was dropped"):
        basis.distances(int(stray[0]))
    S, M = mesh.laplacian()
    assert S.shape == (len(vertices),) * 2 and np.isclose(M.sum(), knot.area) and abs(S[stray]).sum() == 0


def test_merged_vertices_share_mass_and_values(knot, knot_basis):
    vertices, faces = knot.vertices[knot.faces].reshape(-1, 3), np.arange(3 * len(knot.faces)).reshape(-1, 3)
    mesh = chladni.Mesh(vertices, faces, merge="always")
    assert len(mesh.kept_vertices) == len(knot.vertices)
    basis = chladni.eigs(mesh, k=40, method="hsim")
    assert np.allclose(basis.values, knot_basis.values, atol=1e-7) and basis.shape == (len(vertices), 40)
    assert np.isclose(basis.mass.sum(), knot.area)
    assert np.allclose(basis.vectors.T @ (basis.mass[:, None] * basis.vectors), np.eye(40), atol=1e-8)
    sparse = chladni.eigs(mesh, k=5, method="hsim", mass="consistent")
    assert np.allclose(sparse.vectors.T @ (sparse.mass @ sparse.vectors), np.eye(5), atol=1e-8)


def test_files_are_read_and_told_apart(tmp_path, knot, expected):
    import gzip

    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in knot.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (knot.faces + 1).tolist()]
    text = "\n".join(lines).encode()
    (tmp_path / "knot.obj").write_bytes(text)
    (tmp_path / "knot.obj.gz").write_bytes(gzip.compress(text))
    for name in ("knot.obj", "knot.obj.gz"):
        mesh = chladni.Mesh.read(tmp_path / name)
        assert np.array_equal(mesh.vertices, knot.vertices) and np.allclose(spectrum(mesh), expected, atol=1e-9)
    (tmp_path / "broken.obj").write_text("v 0 0 0\nf 1 2 x\n")
    with pytest.raises(chladni.FormatError, match="2"):
        chladni.Mesh.read(tmp_path / "broken.obj")
    (tmp_path / "unknown.xyz").write_text("what is this")
    with pytest.raises(chladni.FormatError, match="unknown.xyz"):
        chladni.Mesh.read(tmp_path / "unknown.xyz")
    with pytest.raises(FileNotFoundError):
        chladni.Mesh.read(tmp_path / "none.obj")


def test_meshes_are_pickled_and_told(knot):
    again = pickle.loads(pickle.dumps(knot))
    assert np.array_equal(again.vertices, knot.vertices) and again.report == knot.report
    assert repr(knot) == "<chladni.Mesh: 2996 vertices, 5992 faces, genus 1, closed>"
    assert knot.report["genus"] == 1 and np.isclose(knot.area, knot.report["area"])
    assert len(chladni.Mesh(SQUARE, TWO, subdivide=2).kept_faces) == 32
    finer = chladni.Mesh(SQUARE, TWO, subdivide=2)
    S, M = finer.laplacian()
    n = len(finer.kept_vertices)
    assert S.shape == M.shape == (n, n) and n > len(SQUARE)
    assert abs(S.sum(axis=1)).max() < 1e-12 and abs(M.sum() - finer.area) < 1e-12
    linear = finer.kept_vertices[:, 0]
    assert abs(linear @ S @ linear - finer.area) < 1e-12
