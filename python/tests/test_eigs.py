"""Eigenpairs against SciPy, and against what is known of spheres, tori and cubes."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

import chladni
from conftest import cube, torus_grid


def lowest(S, M, k):
    """SciPy's lowest pairs by shift-invert, with the shift below the spectrum."""
    shift = -1e-2 * abs(S.diagonal()).mean() / M.diagonal().mean() / S.shape[0]
    return scipy.sparse.linalg.eigsh(S.tocsc(), k=k, M=M.tocsc(), sigma=shift)


@pytest.mark.parametrize("mass", ["barycentric", "voronoi", "consistent"])
def test_pairs_are_scipys(knot, mass):
    basis = chladni.eigs(knot, k=30, method="hsim", tol=1e-9, mass=mass)
    S, M = knot.laplacian(mass=mass)
    values, vectors = lowest(S, M, 30)
    assert np.allclose(basis.values, values, rtol=1e-9, atol=1e-9)
    # Spans of well separated parts of the spectrum are the same.
    gap = 20 + int(np.argmax(np.diff(values[20:])))
    own, other = basis.vectors[:, : gap + 1], vectors[:, : gap + 1]
    angles = scipy.linalg.svdvals(own.T @ (M @ other))
    assert np.allclose(angles, 1, atol=1e-8)
    weighted = basis.mass @ basis.vectors if scipy.sparse.issparse(basis.mass) else basis.mass[:, None] * basis.vectors
    assert np.allclose(basis.vectors.T @ weighted, np.eye(30), atol=1e-9)
    assert basis.complete and basis.certificate.tolerance == 1e-9
    assert (abs(basis.values - values) <= basis.bounds + 1e-10).all()
    residuals = np.linalg.norm(S @ basis.vectors - M @ basis.vectors * basis.values, axis=0)
    norms = np.linalg.norm(S @ basis.vectors, axis=0)
    assert (residuals[1:] <= 1.01e-9 * norms[1:]).all()


def test_the_sphere_has_its_multiplets(sphere):
    basis = chladni.eigs(sphere, k=25, method="hsim")
    exact = np.repeat([degree * (degree + 1) for degree in range(5)], [2 * degree + 1 for degree in range(5)])
    assert np.allclose(basis.values, exact, rtol=0.01, atol=1e-8)


def test_a_flat_torus_by_its_intrinsic_metric():
    """A torus that lies in four dimensions has no equal in three; a rolled-up strip with glued ends does, up to its bend: thin and long."""
    places, faces = torus_grid(240, 12)
    major, minor = 20.0, 0.2
    u, v = 2 * np.pi * places.T
    around = major + minor * np.cos(v)
    vertices = np.stack([around * np.cos(u), around * np.sin(u), minor * np.sin(v)], -1)
    values = chladni.eigs(vertices, faces, k=9, method="hsim").values
    exact = np.repeat([0, 1, 4, 9, 16], [1, 2, 2, 2, 2]) / major**2
    assert np.allclose(values, exact, rtol=0.02, atol=1e-9)


def test_a_cube_is_symmetric():
    """Eigenvalues of a surface with the rotations of the cube come in ones, twos and threes; flat sides unfold to known ones."""
    vertices, faces = cube(16)
    basis = chladni.eigs(vertices, faces, k=20, method="hsim")
    S, M = chladni.Mesh(vertices, faces).laplacian()
    assert np.allclose(basis.values, lowest(S, M, 20)[0], rtol=1e-8, atol=1e-8)
    # cos(π x) cos(π y) on every side, of period two over each edge, is smooth on the whole surface: its value is 2 π² on the unit cube.
    assert abs(basis.values - 2 * np.pi**2).min() < 0.02 * 2 * np.pi**2


def test_dirichlet_and_interval_and_bound():
    mesh = chladni.Mesh.sample("rectangle", 3000)
    exact = np.sort([np.pi**2 * ((a / 1.6) ** 2 + b**2) for a in range(1, 9) for b in range(1, 9)])
    clamped = chladni.eigs(mesh, k=8, method="hsim", boundary="dirichlet")
    assert np.allclose(clamped.values, exact[:8], rtol=0.01)
    free = chladni.eigs(mesh, k=40, method="hsim").values
    below = chladni.eigs(mesh, below=100.0)
    assert below.complete and np.allclose(below.values, free[free < 100], rtol=1e-7, atol=1e-7)
    between = chladni.eigs(mesh, between=(50.0, 100.0))
    inside = free[(free >= 50) & (free < 100)]
    assert between.complete and between.certificate.first == (free < 50).sum()
    assert np.allclose(between.values, inside, rtol=1e-7)
    with pytest.raises(chladni.ParameterError):
        chladni.eigs(mesh, below=100.0, k=2)


def test_approximations_tell_how_far_they_are(knot, knot_basis):
    basis = chladni.eigs(knot, k=40, method="approximate")
    assert basis.complete is None and basis.dimension is not None
    off = abs(basis.values[1:] - knot_basis.values[1:])
    assert (off <= 0.02 * knot_basis.values[1:]).all() and (off <= basis.bounds[1:]).all()
    assert len(basis.estimates) == 40
    compact = chladni.eigs(knot, k=40, method="hsim", storage="compact")
    assert compact.dimension is not None and np.allclose(compact.values, knot_basis.values, atol=1e-7)


def test_operators_by_name_and_by_dictionary(sphere):
    n = len(sphere.vertices)
    potential = np.full(n, 3.0)
    shifted = chladni.eigs(sphere, k=9, method="hsim", operator={"hamiltonian": {"potential": {"values": potential}}})
    plain = chladni.eigs(sphere, k=9, method="hsim")
    assert np.allclose(shifted.values, plain.values + 3, atol=1e-6)
    fields = chladni.eigs(sphere, k=6, operator="hodge")
    assert fields.shape == (2 * len(sphere.faces), 6) and np.allclose(fields.values, 2, rtol=0.01)
    assert fields.mass.shape == (2 * len(sphere.faces),)
    with pytest.raises(chladni.ParameterError, match="fields"):
        fields.signatures()


def test_the_same_seed_gives_the_same_answer(knot):
    first, second = (chladni.eigs(knot, k=20, method="hsim", seed=7) for _ in range(2))
    assert np.array_equal(first.values, second.values) and np.array_equal(first.vectors, second.vectors)


def test_two_components_have_two_zeros_and_stages_take_time(sphere):
    n = len(sphere.vertices)
    vertices = np.concatenate([sphere.vertices, sphere.vertices + 5])
    faces = np.concatenate([sphere.faces, sphere.faces + n])
    basis = chladni.eigs(vertices, faces, k=8, method="hsim")
    assert (abs(basis.values[:2]) < 1e-7).all() and np.allclose(basis.values[2:8], 2, rtol=0.01)
    assert basis.seconds and all(seconds >= 0 for seconds in basis.seconds.values())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"k": 0}, "^k must be at least 1, got 0"),
        ({"k": 10_000}, "count"),
        ({"method": "magic"}, "^method must be one of .*, got 'magic'"),
        ({"tol": 1e-30}, "tolerance"),
        ({"tol": 1e-6, "method": "approximate"}, "tolerance"),
        ({"mass": "heavy"}, "mass"),
        ({"boundary": "robin"}, "boundary"),
        ({"operator": {"extrinsic": {"t": 2.0}}}, "extrinsic"),
        ({"operator": {"hamiltonian": {"potential": {"values": [1.0]}}}}, "potential"),
        ({"between": (2.0, 1.0)}, "between"),
        ({"nonsense": 1}, "nonsense"),
        ({"operator": "volume"}, "solid"),
    ],
)
def test_refusals_name_the_argument(sphere, arguments, message):
    with pytest.raises(chladni.ParameterError, match=message) as caught:
        chladni.eigs(sphere, **arguments)
    assert isinstance(caught.value, (chladni.Error, ValueError)) and caught.value.code == "invalid-parameters"


@pytest.mark.parametrize("k", [2.999, "5", True, float("nan"), float("inf"), [3], 2.5])
@pytest.mark.parametrize("call", ["eigs", "eigsh", "vibration", "interval"])
def test_counts_that_are_no_whole_numbers_are_refused(sphere, k, call):
    calls = {
        "eigs": lambda: chladni.eigs(sphere, k=k),
        "interval": lambda: chladni.eigs(sphere, k=k, below=3.0),
        "eigsh": lambda: chladni.eigsh(scipy.sparse.eye(5), k=k),
        "vibration": lambda: chladni.vibration(sphere, k=k, thickness=0.01),
    }
    with pytest.raises(chladni.ParameterError, match="^k must be a whole number, got "):
        calls[call]()


def test_whole_numbers_of_any_type_are_counts(sphere):
    for k in (4, 4.0, np.int16(4), np.float64(4.0), np.array(4)):
        assert len(chladni.eigs(sphere, k=k).values) == 4


@pytest.mark.parametrize("arguments", [{"tol": np.nan}, {"tol": "small"}, {"below": np.inf}, {"between": (0.0, np.nan)}, {"seed": 1.5}])
def test_numbers_that_are_none_are_refused_by_name(sphere, arguments):
    (name,) = arguments
    with pytest.raises(chladni.ParameterError, match=f"^{name} must be "):
        chladni.eigs(sphere, **arguments)
