"""Meshes: from arrays, from files, from the objects of other libraries."""

from __future__ import annotations

import gzip
import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any, Callable

import numpy as np

from . import _arrays, _native

if TYPE_CHECKING:
    import scipy.sparse


class Mesh:
    """A triangle mesh, checked, and repaired where that loses nothing.

    Vertices that no face uses are set aside, faces that repeat a vertex or another face are dropped, faces are turned over so that neighbours agree. Whatever is
    asked and answered afterwards is numbered as `vertices` and `faces` are: see `vertex_map`.

    Parameters
    ----------
    vertices : array_like, (n, 3) or (n, 2)
        Positions, of any real type, order and layout. Or an object that has a mesh: of trimesh (``.vertices``, ``.faces``), pyvista (``.points``,
        ``.regular_faces``), meshio (``.points``, ``.cells_dict``), Open3D (``.vertices``, ``.triangles``), or a pair of arrays.
    faces : array_like of int, (f, 3), optional
        Triangles, by the numbers of their vertices from 0.
    merge : {"never", "auto", "always"}
        Whether vertices at exactly equal positions become one.
    subdivide : int
        How often every face is divided into four: 0 to 6.

    Raises
    ------
    MeshError
        The first element that makes the mesh unusable is named.
    ParameterError
        The arrays have another shape or type.

    Examples
    --------
    >>> import chladni
    >>> mesh = chladni.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> mesh
    <chladni.Mesh: 4 vertices, 4 faces, genus 0, closed>
    >>> chladni.Mesh(mesh.vertices, [[0, 1, 4]])
    Traceback (most recent call last):
        ...
    chladni.MeshError: face 0 refers to vertex 4 of 4
    """

    _core: _native.Mesh

    def __init__(self, vertices: Any, faces: Any = None, *, merge: str = "never", subdivide: int = 0) -> None:
        if faces is None:
            vertices, faces = arrays_of(vertices)
        positions, triangles = _arrays.positions(vertices), _arrays.triangles(faces)
        self._core = _native.Mesh.from_arrays(positions, triangles, merge, _arrays.whole(subdivide, "subdivide"))

    @classmethod
    def _of(cls, native: _native.Mesh) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._core = native
        return mesh

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        merge: str = "auto",
        surface: str = "boundary",
        subdivide: int = 0,
    ) -> Mesh:
        """Read a mesh file.

        Parameters
        ----------
        path : path
            OBJ, PLY, OFF, STL, MEDIT, VTK (legacy, .vtp, .vtu), Gmsh, FreeSurfer, glTF, GIFTI, or arrays as NPZ or JSON; also compressed by gzip.
        format : str, optional
            Where neither the name nor the content tells.
        merge : {"auto", "always", "never"}
            Whether vertices at equal positions become one; "auto": where the format splits them, as STL does.
        surface : {"boundary", "given"}
            Of a file with tetrahedra: where they have no neighbour, or the triangles of the file.
        subdivide : int
            As for the class.

        Returns
        -------
        Mesh

        Raises
        ------
        FormatError
            The line or the byte that cannot be read is named.
        MeshError
            As for the class.
        """
        with open(path, "rb") as file:
            content = file.read()
        name = os.fspath(path)
        if content[:2] == b"\x1f\x8b":
            content = gzip.decompress(content)
            name = name[:-3] if name.lower().endswith(".gz") else name
        return cls._of(_native.Mesh.from_bytes(content, os.path.basename(name), format, merge, surface, _arrays.whole(subdivide, "subdivide")))

    @classmethod
    def sample(cls, shape: str, vertices: int = 1000) -> Mesh:
        """Generate a shape to try things on.

        Parameters
        ----------
        shape : str
            ``"sphere"`` (of radius 1), ``"torus"``, ``"disk"``, ``"rectangle"`` (1.6 × 1), ``"knot"``, ``"bell"``, ``"violin"``, ``"starfish"``, or ``"genus-G"``.
        vertices : int
            About how many vertices.

        Returns
        -------
        Mesh

        Examples
        --------
        >>> import chladni
        >>> chladni.Mesh.sample("genus-2", 2000).report["genus"]
        2
        """
        return cls(*_native.sample(shape, _arrays.whole(vertices, "vertices")))

    @cached_property
    def _given(self) -> tuple[np.ndarray, np.ndarray]:
        return _locked(self._core.given())

    @cached_property
    def _kept(self) -> tuple[np.ndarray, np.ndarray]:
        return _locked(self._core.kept())

    @property
    def vertices(self) -> np.ndarray:
        """Positions as they were given, (n, 3) float64."""
        return self._given[0]

    @property
    def faces(self) -> np.ndarray:
        """Triangles as they were given, (f, 3) int64. Polygons of a file are triangles here."""
        return self._given[1]

    @property
    def kept_vertices(self) -> np.ndarray:
        """Positions of the mesh that was kept after repairs, (n', 3) float64."""
        return self._kept[0]

    @property
    def kept_faces(self) -> np.ndarray:
        """Triangles of the mesh that was kept after repairs, (f', 3) int64."""
        return self._kept[1]

    @cached_property
    def vertex_map(self) -> np.ndarray:
        """For each vertex that was given the kept one, (n,) int64; −1 where it was dropped."""
        return self._core.vertex_map()

    @cached_property
    def face_map(self) -> np.ndarray:
        """For each kept face the given one that it is or is a part of, (f',) int64."""
        return self._core.face_map()

    @cached_property
    def report(self) -> dict[str, Any]:
        """What the check found and repaired: area, genus, components, boundary, defects with examples, repairs."""
        report: dict[str, Any] = json.loads(self._core.report())
        return report

    @property
    def area(self) -> float:
        """The area, in squared units of the positions."""
        return float(self.report["area"])

    def laplacian(
        self,
        operator: str | dict[str, Any] = "auto",
        *,
        mass: str = "barycentric",
    ) -> tuple[scipy.sparse.csr_matrix, scipy.sparse.csr_matrix]:
        """Stiffness and mass matrix, as SciPy takes them.

        Parameters
        ----------
        operator : str or dict
            As for `eigs`.
        mass : {"barycentric", "voronoi", "consistent"}
            The mass matrix.

        Returns
        -------
        S : scipy.sparse.csr_matrix, (n, n)
            Positive semi-definite, rows sum to zero; without unit.
        M : scipy.sparse.csr_matrix, (n, n)
            In squared units of the positions; its entries sum to the area. Rows of vertices that were dropped are zero in both. Of a mesh that was subdivided both
            are those of the kept mesh, (n', n'), whose vertices are `kept_vertices`.

        Examples
        --------
        >>> import chladni
        >>> S, M = chladni.Mesh.sample("sphere", 642).laplacian()
        >>> bool(abs(S.sum(axis=1)).max() < 1e-12), round(float(M.sum()) / 3.14159, 2)
        (True, 3.98)
        """
        import scipy.sparse

        request = {"operator": operator, "mass": mass, "boundary": "neumann"}
        stiffness, weights, _, _ = self._core.pencil(json.dumps(request))
        size = len(self.kept_vertices)
        S = scipy.sparse.csr_matrix(stiffness, shape=(size, size))
        if isinstance(weights, tuple):
            M = scipy.sparse.csr_matrix(weights, shape=(size, size))
        else:
            M = scipy.sparse.diags(weights, format="csr")
        # Vertices that subdivision made have no place among the given ones, and without them neither matrix is that of the surface.
        spread = None if self.report.get("subdivisions") else spreading(self.vertex_map, size)
        if spread is None:
            return S, M
        return (spread @ S @ spread.T).tocsr(), (spread @ M @ spread.T).tocsr()

    def geodesics(
        self,
        sources: Any = None,
        *,
        pairs: Any = None,
        method: str = "heat",
        time: float | None = None,
        nearest: bool = False,
        extend: str = "none",
    ) -> np.ndarray:
        """Geodesic distances on the mesh.

        Parameters
        ----------
        sources : int or array_like of int, (s,), optional
            Vertices that distances are measured from.
        pairs : array_like of int, (p, 2), optional
            Instead of sources: pairs of vertices to measure between.
        method : {"heat", "exact"}
            The heat method, a percent or two off and milliseconds a source once the mesh is prepared; or the lengths of shortest paths over the faces.
        time : float, optional
            How long heat flows, in squared units of the positions.
        nearest : bool
            Whether to give the distance to the nearest source alone.
        extend : {"none", "nearest"}
            What vertices that no face uses are given: NaN, or what the nearest vertex has.

        Returns
        -------
        numpy.ndarray
            (n,) for one source or with `nearest`, (n, s) for a list, (p,) for pairs. Infinite where no path leads.

        Warns
        -----
        RuntimeWarning
            Where distances by heat may be more than a tenth off, as their slopes tell.

        Examples
        --------
        >>> import chladni
        >>> mesh = chladni.Mesh.sample("sphere", 642)
        >>> round(float(mesh.geodesics(0, method="exact").max()), 1)
        3.1
        """
        _arrays.flag(method, "method", ("heat", "exact"))
        distance: dict[str, Any] = {"kind": "geodesic", "method": method}
        if time is not None:
            distance["time"] = float(time)
        request, shape = distance_request(distance, sources, pairs, nearest)
        return shape(self._core.distances(json.dumps(request), is_nearest(extend)))

    def __reduce__(self) -> tuple[Any, ...]:
        if self.report.get("solid"):
            raise TypeError("a mesh of a solid cannot be pickled; keep its file")
        merged = any(repair["kind"] == "merged_vertices" for repair in self.report["repairs"])
        arguments = (self.vertices, self.faces, int(self.report.get("subdivisions", 0)), "always" if merged else "never")
        if not self.report.get("polygons"):
            return _rebuild, arguments
        if len(self.face_map) != len(self.faces):
            raise TypeError("a mesh of polygons some of whose faces were dropped cannot be pickled; keep its file")
        return _rebuild, (*arguments, self.face_map.tolist())

    def __repr__(self) -> str:
        report = self.report
        if report.get("points"):
            return f"<chladni.Mesh: {len(self.vertices)} points>"
        genus = f", genus {report['genus']}" if report.get("genus") is not None else ", not manifold or not orientable"
        closed = ", closed" if report["closed"] else f", {report['boundary_loops']} boundary loops"
        solid = report.get("solid")
        if solid:
            # Faces are those of its surface, whatever the arrays or the file had of them.
            return f"<chladni.Mesh: a solid of {solid['vertices']} vertices and {solid['tetrahedra']} tetrahedra, with a surface of {report['faces']} faces{genus}{closed}>"
        return f"<chladni.Mesh: {len(self.vertices)} vertices, {len(self.faces)} faces{genus}{closed}>"


def _rebuild(vertices: np.ndarray, faces: np.ndarray, subdivide: int, merge: str, polygons: list[int] | None = None) -> Mesh:
    if polygons is None:
        return Mesh(vertices, faces, merge=merge, subdivide=subdivide)
    return Mesh._of(_native.Mesh.from_arrays(vertices, faces, merge, subdivide, polygons))


def _locked(arrays: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The same arrays, which nobody can change under the mesh that they describe."""
    for array in arrays:
        array.setflags(write=False)
    return arrays


def spreading(vertex_map: np.ndarray, size: int) -> scipy.sparse.csr_matrix | None:
    """The matrix that gives each given vertex its share of the kept one, (n, n'); None where they are the same."""
    import scipy.sparse

    if len(vertex_map) == size and np.array_equal(vertex_map, np.arange(size)):
        return None
    rows = np.flatnonzero((vertex_map >= 0) & (vertex_map < size))
    kept = vertex_map[rows]
    shares = 1.0 / np.bincount(kept, minlength=size)[kept]
    return scipy.sparse.csr_matrix((shares, (rows, kept)), shape=(len(vertex_map), size))


def is_nearest(extend: str) -> bool:
    """Whether dropped vertices take what the nearest one has."""
    _arrays.flag(extend, "extend", ("none", "nearest"))
    return extend == "nearest"


def distance_request(
    distance: dict[str, Any], sources: Any, pairs: Any, nearest: bool
) -> tuple[dict[str, Any], Callable[[np.ndarray], np.ndarray]]:
    """A request for distances, and what gives its answer the shape that was asked for."""
    if (sources is None) == (pairs is None):
        told = "but neither was given" if sources is None else "not both"
        raise _arrays.parameter_error(f"give either sources or pairs, {told}")
    request: dict[str, Any] = {"distance": distance, "nearest": bool(nearest)}
    times = distance.get("times")
    if pairs is not None:
        listed = np.asarray(pairs)
        if listed.dtype.kind not in "iu" or listed.ndim != 2 or listed.shape[1] != 2:
            raise _arrays.parameter_error(f"pairs must be integers of shape (p, 2), got {listed.dtype} of shape {listed.shape}")
        request["pairs"] = [_arrays.vertex_list(pair, "pairs")[0] for pair in listed]
        return request, lambda table: table if times is not None else table[:, 0]
    request["sources"], single = _arrays.vertex_list(sources, "sources")

    def shape(table: np.ndarray) -> np.ndarray:
        if times is None:
            return table[:, 0] if single or nearest else table
        columns = 1 if nearest else len(request["sources"])
        table = table.reshape(len(table), columns, len(times))
        return table[:, 0] if single or nearest else table

    return request, shape


def arrays_of(something: Any) -> tuple[Any, Any]:
    """Positions and triangles of an object of another library."""
    if isinstance(something, Mesh):
        return something.vertices, something.faces
    if isinstance(something, (tuple, list)) and len(something) == 2:
        return something[0], something[1]
    if hasattr(something, "points"):
        if hasattr(something, "cells_dict"):
            # meshio names kinds of cells, the grids of pyvista number them as VTK does: 5 is a triangle.
            cells = something.cells_dict
            triangles = next((key for key in cells if key in ("triangle", 5)), None)
            if triangles is None:
                raise _arrays.parameter_error(f"the mesh has no triangles; its cells are {', '.join(map(str, cells)) or 'none'}")
            return something.points, cells[triangles]
        if hasattr(something, "faces"):
            return something.points, regular_faces(something.faces)
    if hasattr(something, "vertices"):
        for name in ("faces", "triangles"):
            if hasattr(something, name):
                return np.asarray(something.vertices), np.asarray(getattr(something, name))
    kind = "an array" if isinstance(something, np.ndarray) else f"an object of the type {type(something).__name__}"
    raise _arrays.parameter_error(f"{kind} is not a mesh; pass vertices and faces")


def regular_faces(listed: Any) -> np.ndarray:
    """Triangles of VTK's list, in which each face is led by its number of corners."""
    padded: np.ndarray = np.asarray(listed)
    if padded.ndim == 2:
        return padded
    if len(padded) % 4 or (padded[::4] != 3).any():
        raise _arrays.parameter_error("faces of the mesh are not all triangles; triangulate() makes them so")
    return padded.reshape(-1, 4)[:, 1:]


def as_mesh(mesh: Any, faces: Any = None) -> Mesh:
    """A mesh as it is, or made of what is given."""
    return mesh if isinstance(mesh, Mesh) and faces is None else Mesh(mesh, faces)
