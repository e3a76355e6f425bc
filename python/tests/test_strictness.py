"""What is not taken silently, and what is said instead."""

import numpy as np
import pytest
import scipy.sparse

import chladni


def test_a_basis_is_not_taken_for_one_of_another_mesh(tmp_path):
    mesh = chladni.Mesh.sample("knot", 600)
    chladni.eigs(mesh, k=8, method="hsim").save(tmp_path / "knot.npz")
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    n = len(vertices)
    for same in (vertices, vertices.astype(np.float32), vertices[:, [1, 2, 0]] + 3):
        assert chladni.Basis.load(tmp_path / "knot.npz", chladni.Mesh(same, faces)).shape == (n, 8)
    for other in (chladni.Mesh(1.5 * vertices, faces), chladni.Mesh(vertices[::-1], n - 1 - faces)):
        with pytest.raises(chladni.ParameterError, match="does not belong to this mesh: vertex 0 has the mass"):
            chladni.Basis.load(tmp_path / "knot.npz", other)


def test_arguments_without_effect_are_refused(knot_basis):
    for arguments, words in [
        ({"times": [0.1], "count": 5}, "either times or count"),
        ({"kind": "wks", "times": [0.1]}, "times belong to the heat kernel"),
        ({"kind": "gps", "normalised": True}, "normalised belongs to the heat kernel"),
    ]:
        with pytest.raises(chladni.ParameterError, match=words):
            knot_basis.signatures(**arguments)


def test_functions_are_finite_where_vertices_are_kept(knot):
    vertices = np.concatenate([[[7.0, 7, 7]], knot.vertices])
    basis = chladni.eigs(vertices, knot.faces + 1, k=10, method="hsim")
    given = vertices.copy()
    given[0] = np.nan
    assert np.isfinite(basis.project(given)).all() and np.isfinite(basis.filter(given, "heat", time=0.1)[1:]).all()
    given[8, 1] = np.nan
    for use in (basis.project, lambda f: basis.filter(f, "heat", time=0.1)):
        with pytest.raises(chladni.ParameterError, match="functions must be finite numbers, got nan at vertex 8 of function 1$"):
            use(given)
        with pytest.raises(chladni.ParameterError, match="functions must be finite numbers, got inf at vertex 3$"):
            use(np.where(np.arange(len(given)) == 3, np.inf, 1.0))
    with pytest.raises(chladni.ParameterError, match="coefficients must be finite numbers, got inf at row 3$"):
        basis.reconstruct([1.0, 2.0, 3.0, np.inf])
    with pytest.raises(chladni.ParameterError, match=r"transfer must have finite numbers, but values\[0\] is nan"):
        basis.filter(vertices, lambda eigenvalue: eigenvalue * np.nan)


def test_messages_name_things_as_they_are(knot_basis):
    path = scipy.sparse.diags([np.full(8, -1.0), np.full(9, 2.0), np.full(8, -1.0)], [-1, 0, 1])
    for call, words in [
        (lambda: chladni.eigsh(path, between=(1, 0)), r"between must have the lower bound first, got \(1, 0\)"),
        (lambda: chladni.eigsh(path, k=2, fixed=[-1]), "fixed: entry 0 is row -1"),
        (lambda: chladni.eigs(np.eye(3)), "an array is not a mesh|faces"),
        (lambda: knot_basis.signatures(vertices=np.zeros(2996, dtype=bool)), r"an array of the dtype bool and the shape \(2996,\)"),
    ]:
        with pytest.raises(chladni.ParameterError, match=words) as caught:
            call()
        assert "\n" not in str(caught.value)
    with pytest.raises(chladni.ParameterError, match=r"too small to be precise \(1e-320 at most\)"):
        chladni.eigsh(np.eye(3) * 1e-320, k=2)


def test_a_solid_is_shown_as_one(tmp_path):
    corners = "0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    text = f"MeshVersionFormatted 1\nDimension 3\nVertices\n4\n{corners}Tetrahedra\n1\n1 2 3 4 0\nEnd\n"
    (tmp_path / "one.mesh").write_text(text)
    shown = repr(chladni.Mesh.read(tmp_path / "one.mesh"))
    assert shown == "<chladni.Mesh: a solid of 4 vertices and 1 tetrahedra, with a surface of 4 faces, genus 0, closed>"
