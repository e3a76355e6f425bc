"""What a basis is good for, against the formulas by NumPy."""

import base64
import gzip
import html
import json
import pickle

import numpy as np
import pytest

import chladni


def test_signatures_are_their_formulas(knot_basis):
    values, squares = knot_basis.values, knot_basis.vectors**2
    times = np.array([0.05, 0.5, 2.0])
    heat = squares @ np.exp(-values[:, None] * times)
    assert np.allclose(knot_basis.signatures("hks", times=times), heat, rtol=1e-9)
    traced = heat / np.exp(-values[:, None] * times).sum(axis=0)
    assert np.allclose(knot_basis.signatures("hks", times=times, normalised=True), traced, rtol=1e-9)
    some = [3, 2990, 5]
    assert np.allclose(knot_basis.signatures("hks", times=times, vertices=some), heat[some], rtol=1e-9)
    points = knot_basis.signatures("gps", count=5)
    assert np.allclose(points, knot_basis.vectors[:, 1:6] / np.sqrt(values[1:6]))
    assert knot_basis.signatures("wks").shape == (2996, 100) and knot_basis.signatures().shape == (2996, 16)
    for arguments in [{"kind": "sihks"}, {"times": [-1.0]}, {"vertices": [2996]}, {"vertices": [-1]}, {"vertices": [0.5]}, {"kind": "wks", "count": 3}]:
        with pytest.raises(chladni.ParameterError):
            knot_basis.signatures(**arguments)


def test_distances_are_their_formulas(knot, knot_basis, sphere):
    values, vectors = knot_basis.values[1:], knot_basis.vectors[:, 1:]

    def by(weights, source):
        return np.sqrt((vectors - vectors[source]) ** 2 @ weights)

    assert np.allclose(knot_basis.distances(17), by(values**-2, 17), atol=1e-9)
    both = knot_basis.distances([17, 40], "commute_time")
    assert both.shape == (2996, 2) and np.allclose(both[:, 1], by(1 / values, 40), atol=1e-9)
    times = [0.1, 1.0, 3.0]
    diffusion = knot_basis.distances([17, 40], "diffusion", times=times)
    assert diffusion.shape == (2996, 2, 3)
    assert np.allclose(diffusion[:, 1, 2], by(np.exp(-2 * values * 3.0), 40), atol=1e-9)
    assert np.allclose(knot_basis.distances(40, "diffusion", times=1.0), diffusion[:, 1, 1])
    assert np.allclose(knot_basis.distances([17, 40], nearest=True), np.minimum(by(values**-2, 17), by(values**-2, 40)), atol=1e-9)
    assert np.allclose(knot_basis.distances(pairs=[[17, 3], [40, 9]]), [by(values**-2, 17)[3], by(values**-2, 40)[9]], atol=1e-9)
    exact = knot.geodesics([17, 40], method="exact")
    assert np.allclose(knot_basis.distances([17, 40], "geodesic"), knot.geodesics([17, 40]))
    arcs = np.arccos(np.clip(sphere.vertices @ sphere.vertices[[17, 40]].T, -1, 1))
    assert abs(sphere.geodesics([17, 40], method="exact") - arcs).max() < 0.01
    assert abs(sphere.geodesics([17, 40]) - arcs).mean() < 0.02 * arcs.mean()
    steps = np.linalg.norm(knot.vertices[knot.faces[:, 0]] - knot.vertices[knot.faces[:, 1]], axis=1)
    assert (abs(exact[knot.faces[:, 0]] - exact[knot.faces[:, 1]]) <= steps[:, None] + 1e-9).all()
    # Cells from 1 to 1e-8 in size: distances are off by a tenth, and it is said.
    side = np.linspace(0, 1, 30) ** 8
    corner = (np.arange(29)[:, None] + 30 * np.arange(29)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 31], corner[:, None] + [0, 31, 30]])
    graded = chladni.Mesh(np.stack([np.tile(side, 30), np.repeat(side, 30), np.zeros(900)], 1), faces)
    with pytest.warns(RuntimeWarning, match='method="exact" has no such error'):
        graded.geodesics(0)
    with pytest.raises(chladni.ParameterError, match="neither was given"):
        knot_basis.distances()
    with pytest.raises(chladni.ParameterError, match="2996"):
        knot.geodesics(2996)


def test_filters_and_projections(knot, knot_basis):
    mass, vectors, values = knot_basis.mass, knot_basis.vectors, knot_basis.values
    x = knot.vertices
    coefficients = knot_basis.project(x)
    assert np.allclose(coefficients, vectors.T @ (mass[:, None] * x), atol=1e-12)
    assert np.allclose(knot_basis.reconstruct(coefficients), vectors @ coefficients, atol=1e-12)
    assert np.allclose(knot_basis.reconstruct(coefficients[:7, 0]), vectors[:, :7] @ coefficients[:7, 0], atol=1e-12)
    rest = x - vectors @ coefficients
    heat = vectors @ (np.exp(-0.3 * values)[:, None] * coefficients) + np.exp(-0.3 * values[-1]) * rest
    assert np.allclose(knot_basis.filter(x, "heat", time=0.3), heat, atol=1e-10)
    own = knot_basis.filter(x, lambda value: np.exp(-0.3 * value), beyond=np.exp(-0.3 * values[-1]))
    assert np.allclose(own, heat, atol=1e-10)
    low = knot_basis.filter(x[:, 0], "low_pass", cutoff=values[10])
    assert low.shape == (2996,) and np.allclose(low, vectors[:, :11] @ coefficients[:11, 0], atol=1e-10)
    for functions, transfer, parameters in [
        (x[:-1], "heat", {"time": 1.0}),
        (x, "heat", {"time": -1.0}),
        (x, "heat", {}),
        (x, "boost", {}),
        (x.astype(str), "heat", {"time": 1.0}),
    ]:
        with pytest.raises(chladni.ParameterError):
            knot_basis.filter(functions, transfer, **parameters)


def test_files_keep_everything(tmp_path, knot, knot_basis):
    path = tmp_path / "knot.npz"
    for basis in (knot_basis, chladni.eigs(knot, k=40, method="approximate")):
        basis.save(path)
        for again in (chladni.Basis.load(path), chladni.Basis.load(path, knot), pickle.loads(pickle.dumps(basis))):
            assert np.array_equal(again.values, basis.values) and np.array_equal(again.vectors, basis.vectors)
            assert np.array_equal(again.mass, basis.mass) and again.complete == basis.complete
            assert np.array_equal(again.bounds, basis.bounds) and again.metadata == basis.metadata
        assert np.array_equal(np.load(path)["eigenvalues"], basis.values)
    with pytest.raises(chladni.ParameterError, match="2562"):
        chladni.Basis.load(path, chladni.Mesh.sample("sphere", 2562))
    path.write_bytes(b"PK nothing")
    for mesh in (None, knot):
        with pytest.raises(chladni.FormatError):
            chladni.Basis.load(path, mesh)
    with pytest.raises(FileNotFoundError):
        chladni.Basis.load(tmp_path / "none.npz")
    with pytest.raises(OSError):
        knot_basis.save(tmp_path / "none" / "a.npz")


def test_files_know_the_numbering(tmp_path, knot):
    vertices = np.concatenate([[[7.0, 7, 7]], knot.vertices])
    basis = chladni.eigs(vertices, knot.faces + 1, k=10, method="hsim")
    basis.save(tmp_path / "shifted.npz")
    again = chladni.Basis.load(tmp_path / "shifted.npz")
    assert again.shape == (2997, 10) and np.isnan(again.vectors[0]).all()
    assert np.array_equal(again.vectors[1:], basis.vectors[1:])


def test_modes_are_lifted_by_ranges(knot_basis):
    assert np.array_equal(knot_basis.lift(5, 9), knot_basis.vectors[:, 5:9])
    assert knot_basis.lift(9, 5).shape == (2996, 0) and knot_basis.lift(-1).shape == (2996, 1)
    assert len(knot_basis) == 40 and knot_basis.vectors.flags.f_contiguous and knot_basis.vectors.dtype == np.float64
    assert "40 pairs on 2996 rows by hsim, complete" in repr(knot_basis) and "eigenvalue" in knot_basis._repr_html_()


def test_maps_find_the_identity(knot, knot_basis):
    order = np.random.default_rng(5).permutation(2996)
    back = np.argsort(order)
    other = chladni.eigs(knot.vertices[order], back[knot.faces], k=40, method="hsim")
    landmarks = [(int(v), int(back[v])) for v in (0, 700, 1500, 2200)]
    found = chladni.functional_map(knot_basis, other, landmarks=landmarks, all_points=True, both_ways=True)
    assert (found.to_source.points == order).mean() > 0.99 and (found.to_target.points[order] == np.arange(2996)).mean() > 0.99
    assert found.orthogonality_defect < 0.05 and found.commutativity_defect < 0.05 and found.to_source.matched is None
    assert found.matrix.shape == (40, 40) and abs(abs(np.diag(found.matrix)) - 1).mean() < 0.02
    descriptors = knot.vertices, knot.vertices[order]
    assert chladni.functional_map(knot_basis, other, descriptors=descriptors, pairs=30).matrix.shape == (30, 30)
    with pytest.raises(chladni.ParameterError):
        chladni.functional_map(knot_basis, other)
    with pytest.raises(chladni.ParameterError):
        chladni.functional_map(knot_basis, other, landmarks=[(0, 2996)])


def test_collections_are_mapped_both_ways(knot, knot_basis):
    order = np.random.default_rng(5).permutation(2996)
    back = np.argsort(order)
    other = chladni.eigs(knot.vertices[order], back[knot.faces], k=40, method="hsim")
    told = []
    found = chladni.map_collection([knot_basis, other], pairs=40, samples=1000, polish=False, progress=lambda *news: told.append(news))
    assert told and all(0 <= fraction <= 1 for _, fraction in told)
    assert set(found.maps) == {(0, 1), (1, 0)} and found.triples_error is None
    there, again = found.maps[0, 1].to_source, found.maps[1, 0].to_source
    assert there.points.shape == (2996,) and there.matched is None and (there.confidences <= 1).all()
    # The knot has symmetries, so that the identity is one map of several; but going there and back leads home.
    assert (again.points[there.points] == np.arange(2996)).mean() > 0.9 and found.pairs_error < 0.01
    assert found.maps[1, 0].matrix.shape == (40, 40) and found.maps[1, 0].disagreement < 0.2
    with pytest.raises(chladni.ParameterError):
        chladni.map_collection([knot_basis])
    with pytest.raises(chladni.ParameterError):
        chladni.map_collection([knot_basis, other], pairs=41)


def test_polygons_keep_their_shape(tmp_path):
    side = np.linspace(0, 1, 9)
    vertices = np.stack([*np.meshgrid(side, side), np.zeros((9, 9))], axis=-1).reshape(-1, 3)
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    quads = np.stack([corner, corner + 1, corner + 10, corner + 9], axis=1)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + ["f " + " ".join(str(v + 1) for v in quad) for quad in quads]
    (tmp_path / "quads.obj").write_text("\n".join(lines))
    mesh = chladni.Mesh.read(tmp_path / "quads.obj")
    assert mesh.report["polygons"] == 64 and mesh.faces.shape == (128, 3)
    assert pickle.loads(pickle.dumps(mesh)).report["polygons"] == 64
    values = {operator: chladni.eigs(mesh, k=6, operator=operator, method="hsim", tol=1e-9).values for operator in ("auto", "polygon", "laplace")}
    assert np.array_equal(values["auto"], values["polygon"]) and abs(values["auto"] - values["laplace"]).max() > 0.1
    # No diagonal tells one direction from the other.
    assert abs(values["polygon"][1] - values["polygon"][2]) < 1e-7


def test_fields_follow_strokes(knot):
    space = chladni.fields(knot, dimension=200)
    field, about = space.design([{"face": 100, "direction": [0, 0, 1]}], [{"face": 4000, "direction": [1, 0, 0]}])
    assert field.shape == (5992, 3) and field.dtype == np.float32
    corners = knot.vertices[knot.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert abs((field * normals).sum(axis=1)).max() < 1e-5
    tangent = np.array([1.0, 0, 0]) - normals[4000] * normals[4000][0] / (normals[4000] @ normals[4000])
    assert np.allclose(np.cross(field[4000], tangent), 0, atol=1e-4) and len(about["residuals"]) == 2
    with pytest.raises(chladni.ParameterError):
        space.design([{"face": 5992, "direction": [0, 0, 1]}])


def test_a_notebook_is_shown_the_modes_and_is_given_no_more_than_it_holds(knot, knot_basis, monkeypatch):
    if chladni._native.viewer() is None:
        pytest.skip("built without Node")
    shown = knot_basis._repr_html_()
    assert 'sandbox="allow-scripts"' in shown and "http" not in shown
    page = html.unescape(shown.split('srcdoc="', 1)[1].split('"></iframe>')[0])
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    read = lambda name, kind: np.frombuffer(base64.b64decode(data[name]), kind)  # noqa: E731
    surface = read("surface", "<u4")
    vertices, faces = surface[:2]
    assert (surface[2 : 2 + 3 * vertices].view("<f4").reshape(-1, 3) == knot.vertices.astype("<f4")).all()
    assert (surface[2 + 3 * vertices :].reshape(faces, 3) == knot.faces).all() and data["closed"] is True
    modes = read("modes", "<f4").reshape(20, -1)
    assert np.allclose(modes[7], knot_basis.vectors[:, 7], atol=1e-6) and data["values"] == knot_basis.values[:20].tolist() and data["first"] == 1
    script = page.split('id="viewer">')[1].split("</script>")[0]
    assert gzip.decompress(base64.b64decode(script)) == chladni._native.viewer()
    # With a surface that is too large for a notebook's file, there is the table alone.
    monkeypatch.setattr("chladni._view.NUMBERS", 6 * len(knot.vertices))
    assert "<iframe" not in knot_basis._repr_html_() and "<table>" in knot_basis._repr_html_()


def test_the_gradient_of_a_loss_is_what_differences_say():
    mesh = chladni.Mesh.sample("torus", 300)
    random = np.random.default_rng(7)
    # Without its symmetries, all eigenvalues are simple.
    vertices = mesh.vertices + 0.02 * random.standard_normal(mesh.vertices.shape)
    by_values, by_squares = np.array([0.0, 0.3, -0.2, 0.1]), random.standard_normal((len(vertices), 4))

    def solved(vertices):
        return chladni.eigs(vertices, mesh.faces, k=9, method="hsim", operator="laplace", tol=1e-9, precision="f64")

    def loss(vertices):
        found = solved(vertices)
        return by_values @ found.values[:4] + (by_squares * found.vectors[:, :4] ** 2).sum()

    basis = solved(vertices)
    gradient = basis.loss_gradient(by_values, 2 * by_squares * basis.vectors[:, :4])
    motion, step = random.standard_normal(vertices.shape), 1e-5
    difference = (loss(vertices + step * motion) - loss(vertices - step * motion)) / (2 * step)
    assert abs((gradient * motion).sum() - difference) < 1e-5 * np.abs(gradient * motion).sum()
    assert np.allclose(basis.loss_gradient(by_values, np.zeros((len(vertices), 1))), basis.value_gradient(by_values), rtol=1e-9, atol=1e-12)
    for weights, functions in [([0.0], np.ones((len(vertices) - 1, 1))), ([0.0], np.ones((len(vertices), 10))), ([0.0] * 10, np.ones((len(vertices), 1))), ([[0.0]], np.ones((len(vertices), 1))), ([np.nan], np.ones((len(vertices), 1)))]:
        with pytest.raises(chladni.ParameterError):
            basis.loss_gradient(weights, functions)


def test_modes_are_followed_through_a_crossing():
    sphere = chladni.Mesh.sample("sphere", 642)
    frames = [chladni.Mesh(sphere.vertices * [1, 1.2, height], sphere.faces) for height in (0.9, 1.0, 1.1)]
    first, middle, last = (chladni.eigs(frame, k=9, method="hsim", tol=1e-8, precision="f64") for frame in frames)
    found = first.follow(last, gap=1e-3)
    assert found.modes[:4].tolist() == [0, 1, 3, 2] and found.sure[:4].all() and not found.clusters
    overlaps = overlaps_of(first, last)
    assert np.allclose(found.overlaps, abs(overlaps[np.arange(9), found.modes])) and (found.overlaps > 0.5).all()
    assert (found.signs == np.sign(overlaps[np.arange(9), found.modes])).all()
    # Of all orders this has the greatest sum, as SciPy tells.
    scipy_optimize = pytest.importorskip("scipy.optimize")
    assert (scipy_optimize.linear_sum_assignment(-(overlaps**2))[1] == found.modes).all()
    assert (found.rotation[found.modes, np.arange(9)] == found.signs).all() and abs(found.rotation).sum() == 9
    # By way of the frame where both coincide, and whose functions are turned.
    there, on = first.follow(middle, 9), middle.follow(last, gap=0.01)
    cluster = next(cluster for cluster in there.clusters if 2 in cluster.modes)
    assert cluster.modes.tolist() == [2, 3] and sorted(cluster.followers) == [2, 3]
    block = (first.vectors.T @ (first.mass[:, None] * middle.vectors))[np.ix_(cluster.modes, cluster.followers)]
    u, _, v = np.linalg.svd(block)
    assert np.allclose(cluster.rotation, (u @ v).T)
    through = on.rotation @ there.rotation
    assert np.allclose(through[:4, :4], found.rotation[:4, :4], atol=0.1)
    again = first.follow(first, 5)
    assert np.allclose(again.rotation, np.eye(5), atol=1e-9) and again.modes.dtype == np.int64
    for wrong in [{"pairs": 10}, {"pairs": 0}, {"pairs": 1.5}, {"gap": -1.0}, {"gap": float("nan")}]:
        with pytest.raises(chladni.ParameterError):
            first.follow(last, **wrong)
    with pytest.raises(chladni.ParameterError, match="the other basis 42"):
        first.follow(chladni.eigs(chladni.Mesh.sample("sphere", 42), k=9))
    with pytest.raises(chladni.ParameterError, match="must be a Basis"):
        first.follow(last.vectors)


def overlaps_of(one, other):
    return one.vectors.T @ (one.mass[:, None] * other.vectors) / np.sqrt(one.mass @ other.vectors**2)
