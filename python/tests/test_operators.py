"""What networks keep of a surface, against constructions of its own."""

import numpy as np
import pytest
import scipy.sparse

import chladni


def frames_by_numpy(vertices, faces):
    """The published frames: normals are means of unit face normals, x the axis that is far enough from them, made tangent."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sums = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(sums, faces[:, corner], normals)
    up = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    axis = np.where(abs(up[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    across = axis - up * (axis * up).sum(1, keepdims=True)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([across, np.cross(up, across), up], axis=1)


def gradient_by_lstsq(vertices, faces, frames, values, epsilon):
    """At each vertex the least squares solution, of the differences with ε|g|² as two rows more."""
    n = len(vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    joined = scipy.sparse.coo_matrix((np.ones(len(edges)), edges.T), shape=(n, n))
    joined = (joined + joined.T).tocsr()
    found = np.empty((n, 2))
    for vertex in range(n):
        ring = joined.indices[joined.indptr[vertex] : joined.indptr[vertex + 1]]
        tangent = (vertices[ring] - vertices[vertex]) @ frames[vertex, :2].T
        system = np.vstack([tangent, np.sqrt(epsilon) * np.eye(2)])
        found[vertex] = np.linalg.lstsq(system, np.append(values[ring] - values[vertex], [0, 0]), rcond=None)[0]
    return found


@pytest.fixture(scope="module")
def found(knot):
    return chladni.operators(knot, k=32)


def test_frames_and_gradients_are_the_published_ones(knot, found):
    vertices, faces = knot.vertices, knot.faces
    frames = frames_by_numpy(vertices, faces)
    assert np.allclose(found.frames, frames, atol=1e-5)
    values = np.sin(vertices[:, 0]) * vertices[:, 1]
    expected = gradient_by_lstsq(vertices, faces, found.frames, values, 1e-5)
    assert np.allclose(np.stack([found.gradX @ values, found.gradY @ values], 1), expected, atol=1e-9)
    assert abs(found.gradX.sum(axis=1)).max() < 1e-9, "constants have no gradient"


def test_laplacian_mass_and_pairs_belong_together(knot, found):
    S, M = knot.laplacian()
    assert abs(found.L - S).max() == 0 and np.allclose(found.mass, M.diagonal(), rtol=1e-7)
    assert found.certificate.complete and found.certificate.residuals.max() <= 1e-6
    residual = found.L @ found.evecs - found.mass[:, None] * found.evecs * found.evals
    assert abs(residual).max() < 1e-5 and np.allclose(found.evecs.T @ (found.mass[:, None] * found.evecs), np.eye(32), atol=1e-6)
    assert (found.evals >= 0).all() and np.allclose(found.evals, chladni.eigs(knot, k=32, method="hsim").values, atol=1e-7)


def test_caches_are_of_the_published_layout(tmp_path, knot):
    vertices, faces = knot.vertices.astype(np.float32), knot.faces
    found = chladni.operators(vertices, faces, k=16)
    path = found.save_cache(tmp_path / "cache")
    import hashlib

    digest = hashlib.sha1()
    digest.update(vertices.view(np.uint8))
    digest.update(faces.view(np.uint8))
    assert path.endswith(f"{digest.hexdigest()}_0.npz")
    with np.load(path, allow_pickle=True) as members:
        sparse = [f"{name}_{part}" for name in ("L", "gradX", "gradY") for part in ("data", "indices", "indptr", "shape")]
        assert set(members) == {"verts", "frames", "faces", "k_eig", "mass", "evals", "evecs", *sparse}
        assert np.array_equal(members["verts"], vertices) and members["verts"].dtype == np.float32
        assert np.array_equal(members["faces"], faces) and members["k_eig"].item() == 16
        for name, shape in [("frames", (2996, 3, 3)), ("mass", (2996,)), ("evals", (16,)), ("evecs", (2996, 16))]:
            assert members[name].shape == shape and members[name].dtype == np.float32
        for name in ("L", "gradX", "gradY"):
            parts = tuple(members[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
            matrix = scipy.sparse.csc_matrix(parts, shape=members[f"{name}_shape"])
            assert matrix.dtype == np.float32 and np.allclose((matrix - getattr(found, name)).data, 0, atol=1e-2)
    again = chladni.Operators.load(path)
    assert np.allclose(again.evecs, found.evecs, atol=1e-5) and again.certificate.complete is None
    assert not [file for file in (tmp_path / "cache").iterdir() if file.suffix == ".part"]


def test_vertices_without_faces_stay_in_place(knot):
    vertices = np.concatenate([knot.vertices, [[9.0, 9, 9]]])
    found = chladni.operators(vertices, knot.faces, k=8)
    assert found.evecs.shape == (2997, 8) and (found.evecs[-1] == 0).all() and 0 < found.mass[-1] < 1e-6
    assert np.isfinite(found.frames).all() and (found.gradX @ vertices[:, 0])[-1] == 0
    few = chladni.operators([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], k=128)
    assert few.evecs.shape == (4, 4)
    with pytest.raises(chladni.ParameterError, match="kept_vertices"):
        chladni.operators(chladni.Mesh(knot.vertices, knot.faces, subdivide=1))


def test_points_without_faces_are_refused_by_name(tmp_path):
    path = tmp_path / "points.obj"
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in chladni.Mesh.sample("sphere", 300).vertices))
    points = chladni.Mesh.read(path)
    assert repr(points) == f"<chladni.Mesh: {len(points.vertices)} points>"
    with pytest.raises(chladni.ParameterError, match="only points"):
        chladni.operators(points, k=5)
