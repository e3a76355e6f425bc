"""Eigenbases, and what they are good for."""

from __future__ import annotations

import html
import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any, Callable, TypeVar

import numpy as np

from . import _arrays, _native, _view
from ._certificate import Certificate
from ._following import Following
from ._mesh import Mesh, distance_request, is_nearest, spreading

if TYPE_CHECKING:
    import scipy.sparse


_B = TypeVar("_B", bound="Basis")


class Basis:
    """Eigenpairs of an operator on a mesh: what `eigs` and `Basis.load` give.

    Rows are numbered as the arrays or the file that the mesh was made of. Vertices that no face uses have NaN, unless ``extend="nearest"`` is asked for.

    Attributes
    ----------
    values : numpy.ndarray, (k,)
        Eigenvalues, ascending, in 1/length² of the positions.
    vectors : numpy.ndarray, (n, k)
        Eigenfunctions as columns in Fortran order, orthonormal for `mass`; in each the entry of largest magnitude is positive.
    mass : numpy.ndarray, (n,), or scipy.sparse.csr_matrix, (n, n)
        The mass matrix: its diagonal where it is lumped.
    certificate : Certificate
        What is proven.
    mesh : Mesh or None
        The mesh, where it is at hand.

    Examples
    --------
    >>> import chladni
    >>> basis = chladni.eigs(chladni.Mesh.sample("sphere", 2562), k=9, method="hsim")
    >>> basis.values.round(1)
    array([0., 2., 2., 2., 6., 6., 6., 6., 6.])
    >>> basis.complete
    True
    """

    _core: _native.Basis
    mesh: Mesh | None

    def __init__(self) -> None:
        raise TypeError("a Basis comes from chladni.eigs or chladni.Basis.load")

    @classmethod
    def _of(cls: type[_B], native: _native.Basis, mesh: Mesh | None = None) -> _B:
        basis = cls.__new__(cls)
        basis._core, basis.mesh = native, mesh
        return basis

    @classmethod
    def load(cls, path: str | os.PathLike[str], mesh: Mesh | None = None) -> Basis:
        """Read a basis from an NPZ file of this package, the command line or the service.

        Parameters
        ----------
        path : path
            The file.
        mesh : Mesh, optional
            The mesh that the basis lives on: needed for geodesic distances by it, and numbers the rows. Its masses are compared with those of the basis, so that another mesh of as many
            vertices is not taken for it, nor one that is scaled or numbered differently.

        Returns
        -------
        Basis

        Raises
        ------
        FormatError
            The member that is missing or damaged is named.
        ParameterError
            The mesh is another one; the first vertex that differs is named.
        """
        maps = None
        if mesh is None:
            try:
                with np.load(path) as members:
                    if "vertex_map" in members:
                        maps = members["vertex_map"].astype(np.int32), members["face_map"].astype(np.int32)
            except (ValueError, EOFError) as error:
                raise _format_error(f"{os.fspath(path)}: {error}") from None
            except OSError:
                raise
            except Exception as error:  # zipfile.BadZipFile, whose module need not be imported for this
                raise _format_error(f"{os.fspath(path)}: {error}") from None
        return cls._of(_native.Basis.read(os.fspath(path), None if mesh is None else mesh._core, maps), mesh)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an NPZ file with everything, which NumPy, the command line and the service read too.

        Parameters
        ----------
        path : path
            The file; nothing is appended to its name.
        """
        self._core.write(os.fspath(path))

    @cached_property
    def values(self) -> np.ndarray:  # noqa: D102
        return self._core.values()

    @cached_property
    def vectors(self) -> np.ndarray:  # noqa: D102
        return self.lift()

    def lift(self, start: int = 0, stop: int | None = None, *, extend: str = "none") -> np.ndarray:
        """Some of the eigenfunctions, without all others being made.

        Parameters
        ----------
        start, stop : int
            From which to before which; all by default.
        extend : {"none", "nearest"}
            What vertices that no face uses are given.

        Returns
        -------
        numpy.ndarray, (n, stop − start)
            In Fortran order.
        """
        start, stop, _ = slice(start, stop).indices(len(self))
        if stop <= start:
            return np.empty((self.shape[0], 0))
        return self._core.vectors(start, stop, is_nearest(extend))

    @cached_property
    def mass(self) -> np.ndarray | scipy.sparse.csr_matrix:  # noqa: D102
        import scipy.sparse

        mass = self._core.mass()
        diagonal = not isinstance(mass, tuple)
        if self._core.of_fields():
            return mass
        size = len(mass) if diagonal else len(mass[2]) - 1
        spread = spreading(self.vertex_map, size)
        if diagonal:
            if spread is None:
                return mass
            rows = np.zeros(len(self.vertex_map))
            met = spread.tocoo()
            rows[met.row] = mass[met.col] * met.data
            return rows
        M = scipy.sparse.csr_matrix(mass, shape=(size, size))
        return M if spread is None else (spread @ M @ spread.T).tocsr()

    @cached_property
    def vertex_map(self) -> np.ndarray:
        """For each vertex that was given the row of the basis as it is stored, (n,) int64; −1 where it was dropped."""
        return self._core.vertex_map()

    @cached_property
    def certificate(self) -> Certificate:  # noqa: D102
        return Certificate._of_json(self._core.certificate())

    @property
    def complete(self) -> bool | None:
        """Whether it is proven that no pair is missing; None where nobody counted, as for approximations."""
        return self.certificate.complete

    @property
    def residuals(self) -> np.ndarray:
        """Residuals of the pairs, (k,): see `Certificate`."""
        return self.certificate.residuals

    @property
    def bounds(self) -> np.ndarray:
        """Bounds on the errors of the eigenvalues, (k,): see `Certificate`."""
        return self.certificate.bounds

    @property
    def estimates(self) -> np.ndarray:
        """Estimates of the errors of the eigenvalues, (k,), or (0,) where there are none: see `Certificate`."""
        return self.certificate.estimates

    @cached_property
    def metadata(self) -> dict[str, Any]:
        """How the basis was made: method, parameters with defaults filled in, operator, solver version."""
        made: dict[str, Any] = json.loads(self._core.metadata())
        return made

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds of each stage of the work; empty for a basis that was loaded."""
        return dict(self._core.seconds())

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and pairs, (n, k)."""
        return self._core.shape()

    @property
    def dimension(self) -> int | None:
        """The dimension of the space of a compact basis; None where eigenfunctions are kept as columns."""
        return self._core.dimension()

    def signatures(
        self,
        kind: str = "hks",
        *,
        times: Any = None,
        count: int | None = None,
        normalised: bool = False,
        vertices: Any = None,
        extend: str = "none",
    ) -> np.ndarray:
        """Signatures of points: what the spectrum says about the surface around each vertex.

        Parameters
        ----------
        kind : {"hks", "wks", "gps"}
            The heat kernel signature (Sun et al. 2009), the wave kernel signature (Aubry et al. 2011), or the global point signature (Rustamov 2007).
        times : array_like, (t,), optional
            Of the heat kernel, in squared units of the positions; without them `count`, log-spaced over what the spectrum can tell.
        count : int, optional
            Times (16), energies of the wave kernel (100, at least 32) or modes of the global point signature (20).
        normalised : bool
            Whether the heat kernel is divided by its trace.
        vertices : array_like of int, (p,), optional
            Vertices; all by default.
        extend : {"none", "nearest"}
            What vertices that no face uses are given.

        Returns
        -------
        numpy.ndarray, (n, t) or (p, t)

        Examples
        --------
        >>> import chladni
        >>> basis = chladni.eigs(chladni.Mesh.sample("sphere", 2562), k=25, method="hsim")
        >>> hks = basis.signatures("hks", times=[0.1, 1.0])
        >>> hks.shape, bool(hks.std(axis=0).max() < 0.01)
        ((2562, 2), True)
        """
        _arrays.flag(kind, "kind", ("hks", "wks", "gps"))
        if times is not None and kind != "hks":
            raise _arrays.parameter_error(f"times belong to the heat kernel, \"hks\", and not to \"{kind}\"")
        if times is not None and count is not None:
            raise _arrays.parameter_error("either times or count, not both: each time is a column")
        if normalised and kind != "hks":
            raise _arrays.parameter_error(f"normalised belongs to the heat kernel, \"hks\", and not to \"{kind}\"")
        listed = None if vertices is None else _arrays.vertex_list(vertices, "vertices")[0]
        moments = None if times is None else [float(time) for time in np.atleast_1d(_arrays.numeric(times, "times"))]
        return self._core.signatures(kind, moments, count, bool(normalised), listed, is_nearest(extend))

    def distances(
        self,
        sources: Any = None,
        kind: str = "biharmonic",
        *,
        pairs: Any = None,
        times: Any = None,
        method: str = "heat",
        nearest: bool = False,
        extend: str = "none",
    ) -> np.ndarray:
        """Distances on the surface.

        Parameters
        ----------
        sources : int or array_like of int, (s,), optional
            Vertices that distances are measured from.
        kind : {"biharmonic", "diffusion", "commute_time", "geodesic"}
            Which distance. Geodesic ones need the mesh, beside a basis that was loaded.
        pairs : array_like of int, (p, 2), optional
            Instead of sources: pairs of vertices to measure between.
        times : float or array_like, (t,), optional
            Of the diffusion distance, in squared units of the positions; half the inverse of the first eigenvalue above zero by default.
        method : {"heat", "exact", "spectral"}
            How geodesic distances are computed.
        nearest : bool
            Whether to give the distance to the nearest source alone.
        extend : {"none", "nearest"}
            What vertices that no face uses are given.

        Returns
        -------
        numpy.ndarray
            (n,) for one source or with `nearest`, (n, s) for a list, (p,) for pairs; one axis more, the last, for a list of times.

        Warns
        -----
        RuntimeWarning
            Where geodesic distances by heat may be more than a tenth off, as their slopes tell.
        """
        _arrays.flag(kind, "kind", ("biharmonic", "diffusion", "commute_time", "geodesic"))
        distance: dict[str, Any] = {"kind": kind}
        several = times is not None and np.ndim(times) > 0
        if times is not None:
            if kind != "diffusion":
                raise _arrays.parameter_error("times belong to diffusion distances")
            distance["times"] = [float(time) for time in np.atleast_1d(_arrays.numeric(times, "times"))]
        if kind == "geodesic":
            _arrays.flag(method, "method", ("heat", "exact", "spectral"))
            distance["method"] = method
        request, shape = distance_request(distance, sources, pairs, nearest)
        table = shape(self._core.distances(json.dumps(request), is_nearest(extend)))
        answer: np.ndarray = table[..., 0] if times is not None and not several else table
        return answer

    def value_gradient(self, weights: Any) -> np.ndarray:
        """The gradient of a weighted sum of eigenvalues by the positions of the vertices.

        With the derivatives of a loss by the eigenvalues as weights it is the gradient of the loss. Exact for simple eigenvalues; those that coincide have no derivatives of their own, but
        their sum has, and every loss in which they count alike.

        Parameters
        ----------
        weights : array_like, (m,)
            What each eigenvalue counts, from the first on; those beyond the last do not.

        Returns
        -------
        numpy.ndarray, (n, 3)
            In 1/length³ of the positions. Vertices that were merged share what the kept one has; dropped ones have zero.

        Raises
        ------
        ParameterError
            For operators other than ``"laplace"`` (or ``"auto"`` where it chose that) and ``"volume"``, for Voronoi masses, and for a basis that was loaded without its mesh.

        Examples
        --------
        Eigenvalues fall with the square of the size:

        >>> import chladni, numpy as np
        >>> mesh = chladni.Mesh.sample("knot", 1500)
        >>> basis = chladni.eigs(mesh, k=5, method="hsim", tol=1e-8)
        >>> gradient = basis.value_gradient([0, 1])
        >>> bool(np.isclose((gradient * mesh.vertices).sum(), -2 * basis.values[1]))
        True
        """
        listed = np.atleast_1d(_arrays.numeric(weights, "weights"))
        if listed.ndim != 1:
            raise _arrays.parameter_error(f"weights must have shape (m,), got {listed.shape}")
        return self._core.value_gradient([float(weight) for weight in listed])

    def loss_gradient(self, weights: Any, functions: Any) -> np.ndarray:
        """The gradient by the positions of the vertices of a loss that depends on eigenvalues and eigenfunctions.

        It is as right as the pairs are: solve with ``precision="f64"`` and a small ``tol``. The loss should depend on neither
        the signs of eigenfunctions nor, where eigenvalues coincide, on which functions stand for them.

        Parameters
        ----------
        weights : array_like, (m,)
            The derivatives of the loss by the eigenvalues, from the first on; those beyond the last are zero.
        functions : array_like, (n,) or (n, c)
            Its derivatives by the values of the first `c` eigenfunctions at the vertices.

        Returns
        -------
        numpy.ndarray, (n, 3)
            Vertices that were merged share what the kept one has; dropped ones have zero.

        Raises
        ------
        ParameterError
            As `value_gradient`, and for an approximate basis; where the loss counts a part of a multiplet, or the basis
            ends inside one that counts.

        Examples
        --------
        Functions of unit norm get smaller as their surface gets larger:

        >>> import chladni, numpy as np
        >>> mesh = chladni.Mesh.sample("torus", 500)
        >>> basis = chladni.eigs(mesh, k=6, method="hsim", operator="laplace", tol=1e-8, precision="f64")
        >>> gradient = basis.loss_gradient([], 2 * basis.vectors[:, :3])
        >>> bool(np.isclose((gradient * mesh.vertices).sum(), -2 * (basis.vectors[:, :3] ** 2).sum()))
        True
        """
        listed = np.atleast_1d(_arrays.numeric(weights, "weights"))
        if listed.ndim != 1:
            raise _arrays.parameter_error(f"weights must have shape (m,), got {listed.shape}")
        n = np.shape(functions)[0] if np.ndim(functions) else 0
        derivatives, _ = _arrays.functions(functions, n, "derivatives")
        return self._core.loss_gradient([float(weight) for weight in listed], derivatives)

    def follow(self, other: Basis, pairs: int | None = None, *, gap: float = 0.01) -> Following:
        """Which modes of another basis follow those of this one, as from one frame of an animation to the next.

        Frames have the same vertices in the same order. Where eigenvalues cross, modes change places; signs are arbitrary in every frame, and so are functions of eigenvalues that coincide:
        these are turned together.

        Parameters
        ----------
        other : Basis
            The basis of the next frame.
        pairs : int, optional
            How many of the first pairs of both; without it, as many as both have, at most 1000. Some more than are shown, so that modes that go up are still found.
        gap : float
            Eigenvalues of either basis that follow on each other with at most this relative gap are one cluster. With many pairs less than the distance between two, 1/k at mode k.

        Returns
        -------
        Following

        Examples
        --------
        An ellipsoid becomes longer, and its modes 2 and 3 change places:

        >>> import chladni
        >>> sphere = chladni.Mesh.sample("sphere", 642)
        >>> frames = [chladni.Mesh(sphere.vertices * [1, 1.2, height], sphere.faces) for height in (0.95, 1.05)]
        >>> one, next = [chladni.eigs(frame, k=9, method="hsim") for frame in frames]
        >>> found = one.follow(next)
        >>> found.modes[:4]
        array([0, 1, 3, 2])
        >>> functions = next.vectors @ found.rotation                        # as those of one, with their signs
        >>> bool((one.mass @ (functions * one.vectors)).min() > 0.9)
        True
        """
        if not isinstance(other, Basis) or type(self._core) is not type(other._core):
            raise _arrays.parameter_error("other must be a Basis that is where this one is: here, or on the same server")
        wanted = None if pairs is None else _arrays.whole(pairs, "pairs", 1)
        return Following._of_json(self._core.follow(other._core, wanted, _arrays.number(gap, "gap")))

    def filter(
        self,
        functions: Any,
        transfer: str | dict[str, Any] | Callable[[np.ndarray], np.ndarray] = "low_pass",
        *,
        extend: str = "none",
        **parameters: Any,
    ) -> np.ndarray:
        """Filter functions by their spectrum (Vallet and Lévy 2008): ``Φ F(Λ) ΦᵀM f``, and detail that the basis does not hold times one more factor.

        Parameters
        ----------
        functions : array_like, (n,) or (n, k)
            A value for each vertex; the positions, for example.
        transfer : str, dict or callable
            ``"low_pass"`` and ``"high_pass"`` (`cutoff`), ``"band_pass"`` (`low`, `high`), ``"gain"`` (`low`, `high`, `gain`), ``"heat"`` (`time`),
            ``"sharpen"`` (`cutoff`, `strength`), ``"curve"`` (`points`). Or a function of the eigenvalues, with `beyond` (0 by default) for what the basis
            does not hold.
        extend : {"none", "nearest"}
            What vertices that no face uses are given.
        **parameters
            Those of the transfer function, eigenvalues in 1/length² of the positions.

        Returns
        -------
        numpy.ndarray, of the shape of `functions`

        Examples
        --------
        >>> import chladni
        >>> mesh = chladni.Mesh.sample("knot", 2000)
        >>> basis = chladni.eigs(mesh, k=50)
        >>> smooth = basis.filter(mesh.vertices, "heat", time=0.01)
        >>> same = basis.filter(mesh.vertices, lambda eigenvalue: eigenvalue * 0 + 1, beyond=1.0)
        >>> smooth.shape, bool(abs(same - mesh.vertices).max() < 1e-9)
        ((2000, 3), True)
        """
        if callable(transfer):
            beyond = float(parameters.pop("beyond", 0.0))
            factors = np.broadcast_to(_arrays.numeric(transfer(self.values), "factors"), self.values.shape)
            request: dict[str, Any] = {"kind": "samples", "values": [float(x) for x in factors], "beyond": beyond, **parameters}
        else:
            request = dict(transfer, **parameters) if isinstance(transfer, dict) else {"kind": transfer, **parameters}
        columns, single = self._functions(functions)
        try:
            text = json.dumps(request, default=_plain, allow_nan=False)
        except ValueError:
            raise _arrays.parameter_error(f"transfer must have finite numbers, but {_not_finite(request)}") from None
        filtered = self._core.filter(columns, text, is_nearest(extend))
        return filtered[:, 0] if single else filtered

    def project(self, functions: Any) -> np.ndarray:
        """Coefficients ``ΦᵀM f`` of the nearest combinations of eigenfunctions.

        Parameters
        ----------
        functions : array_like, (n,) or (n, k)
            A value for each vertex.

        Returns
        -------
        numpy.ndarray, (m,) or (m, k)
            A coefficient for each eigenfunction.
        """
        columns, single = self._functions(functions)
        found = self._core.project(columns)
        return found[:, 0] if single else found

    def reconstruct(self, coefficients: Any, *, extend: str = "none") -> np.ndarray:
        """Functions ``Φ c`` of coefficients.

        Parameters
        ----------
        coefficients : array_like, (m,) or (m, k), m ≤ the number of pairs
            A coefficient for each of the first m eigenfunctions.
        extend : {"none", "nearest"}
            What vertices that no face uses are given.

        Returns
        -------
        numpy.ndarray, (n,) or (n, k)
        """
        given = _arrays.numeric(coefficients, "coefficients")
        rows = len(given) if given.ndim else 0
        if not 0 < rows <= len(self):
            raise _arrays.parameter_error(f"coefficients must have 1 to {len(self)} rows, got shape {given.shape}")
        columns, single = _arrays.functions(given, rows, "coefficients")
        _arrays.finite(columns, np.ones(rows, dtype=bool), "coefficients", "row")
        whole = np.zeros((len(self), columns.shape[1]), order="F")
        whole[:rows] = columns
        found = self._core.reconstruct(whole, is_nearest(extend))
        return found[:, 0] if single else found

    def _functions(self, functions: Any) -> tuple[np.ndarray, bool]:
        """Functions in Fortran order, finite wherever a vertex was kept, and whether it was a single one."""
        columns, single = _arrays.functions(functions, self.shape[0], "functions")
        if not np.isfinite(columns).all():
            whole = self._core.of_fields()
            kept = np.ones(len(columns), dtype=bool) if whole else self._core.vertex_map()[: len(columns)] >= 0
            _arrays.finite(columns, kept, "functions")
        return columns, single

    def __len__(self) -> int:
        return self.shape[1]

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (bytes(self._core.to_bytes()), self.mesh, self.vertex_map)

    def __repr__(self) -> str:
        rows, pairs = self.shape
        proven = {True: "complete", False: "not complete", None: "not counted"}[self.complete]
        method = self.metadata.get("method") or self.metadata.get("parameters", {}).get("method", "")
        return f"<chladni.Basis: {pairs} pairs on {rows} rows by {method or 'an unknown method'}, {proven}>"

    def _repr_html_(self) -> str:
        shown = min(len(self), 10)
        rows = "".join(
            f"<tr><td>{k}</td><td>{self.values[k]:.6g}</td><td>{self.residuals[k]:.1e}</td><td>{self.bounds[k]:.1e}</td></tr>"
            for k in range(shown)
        )
        more = f"<tr><td colspan='4'>and {len(self) - shown} more</td></tr>" if shown < len(self) else ""
        head = "<tr><th></th><th>eigenvalue</th><th>residual</th><th>bound</th></tr>"
        return f"<p>{html.escape(repr(self))}</p>{_view.frame(self) or ''}<table>{head}{rows}{more}</table>"


def _not_finite(request: dict[str, Any]) -> str:
    """Which number of a request is none that JSON has."""
    for name, value in request.items():
        if name == "kind":
            continue
        numbers = np.asarray(value, dtype=float)
        if not np.isfinite(numbers).all():
            at = tuple(int(k) for k in np.argwhere(~np.isfinite(numbers))[0])
            return f"{name}{''.join(f'[{k}]' for k in at)} is {numbers[at]}"
    return "a number is infinite or NaN"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} is not a number")


def _format_error(message: str) -> Exception:
    from ._errors import FormatError

    error = FormatError(message)
    error.code = "not-a-basis"
    return error


def _rebuild(content: bytes, mesh: Mesh | None, vertex_map: np.ndarray) -> Basis:
    maps = None if mesh is not None else (vertex_map.astype(np.int32), np.empty(0, dtype=np.int32))
    return Basis._of(_native.Basis.of_bytes(content, None if mesh is None else mesh._core, maps), mesh)
