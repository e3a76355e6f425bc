"""Functional maps between two surfaces."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _arrays, _native
from ._basis import Basis

__all__ = ["CollectionMap", "FunctionalMap", "MapCollection", "PointMap", "functional_map", "map_collection"]


@dataclass(frozen=True, eq=False)
class PointMap:
    """A correspondence: for vertices of one surface, vertices of the other.

    Attributes
    ----------
    matched : numpy.ndarray of int64, (p,), or None
        The vertices that were matched; None: all of them.
    points : numpy.ndarray of int64, (p,)
        For each of them the vertex of the other surface that corresponds to it; −1 where it was dropped.
    confidences : numpy.ndarray, (p,)
        How well the two agree, from 0 to 1.
    """

    matched: np.ndarray | None
    points: np.ndarray
    confidences: np.ndarray


@dataclass(frozen=True, eq=False)
class FunctionalMap:
    """A map between two surfaces, and what tells how good it is.

    Attributes
    ----------
    matrix : numpy.ndarray, (k, k)
        ``C``: takes coefficients on the source to coefficients on the target, both surfaces scaled to unit area.
    to_source : PointMap
        For vertices of the target those of the source.
    to_target : PointMap or None
        The other way, where both were asked for.
    descriptor_residual : float
        ``‖C A − B‖ / ‖B‖`` of the first map.
    orthogonality_defect : float
        ``‖CᵀC − I‖ / √k``: 0 for a map that preserves areas.
    commutativity_defect : float
        ``‖C Λ − Λ' C‖ / ‖C Λ‖``: 0 for an isometry.
    embedding_error : float
        The root mean square of the distances between matched points in the spectral embedding, relative to its size.
    coverage : float
        The share of the source's area whose vertices are matched with some vertex.
    """

    matrix: np.ndarray
    to_source: PointMap
    to_target: PointMap | None
    descriptor_residual: float
    orthogonality_defect: float
    commutativity_defect: float
    embedding_error: float
    coverage: float


def functional_map(
    source: Basis,
    target: Basis,
    *,
    landmarks: Any = (),
    descriptors: tuple[Any, Any] | None = None,
    signatures: bool = False,
    start: int | None = None,
    pairs: int | None = None,
    step: int = 5,
    samples: int = 2000,
    commutativity: float = 0.1,
    all_points: bool = False,
    both_ways: bool = False,
) -> FunctionalMap:
    """Find the map from one surface to another (Ovsjanikov et al. 2012), refined by ZoomOut (Melzi et al. 2019).

    Parameters
    ----------
    source, target : Basis
        Bases of the surface where functions come from, and of that where they go to.
    landmarks : array_like of int, (l, 2)
        Pairs of a vertex of the source and the one of the target that it corresponds to.
    descriptors : (array_like (n_source, q), array_like (n_target, q)), optional
        Functions that are known on both.
    signatures : bool
        Whether heat kernel signatures are used as such functions. They cannot tell the sides of a symmetric shape apart.
    start, pairs, step : int
        The size of the first map (20), of the refined one (100 or what the bases have), and by how much it grows at once.
    samples : int
        Vertices of each surface that stand for it meanwhile.
    commutativity : float
        The weight of the preference for maps that commute with the Laplacians.
    all_points : bool
        Whether every vertex of the target is matched, or only those that stood for it.
    both_ways : bool
        Whether vertices of the source are matched as well, by a map of their own.

    Returns
    -------
    FunctionalMap

    Examples
    --------
    >>> import chladni, numpy
    >>> mesh = chladni.Mesh.sample("knot", 2000)
    >>> turned = chladni.Mesh(mesh.vertices @ numpy.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), mesh.faces)
    >>> a, b = chladni.eigs(mesh, k=40), chladni.eigs(turned, k=40)
    >>> found = chladni.functional_map(a, b, landmarks=[(0, 0), (500, 500), (1200, 1200), (1700, 1700)], all_points=True)
    >>> found.matrix.shape, bool(numpy.mean(found.to_source.points == numpy.arange(2000)) > 0.99)
    ((40, 40), True)
    """
    listed = np.asarray(landmarks, dtype=None if len(landmarks) else np.int64).reshape(-1, 2)
    if listed.dtype.kind not in "iu":
        raise _arrays.parameter_error(f"landmarks must be integers, got dtype {listed.dtype}")
    known = None
    if descriptors is not None:
        first, _ = _arrays.functions(descriptors[0], source.shape[0], "descriptors of the source")
        second, _ = _arrays.functions(descriptors[1], target.shape[0], "descriptors of the target")
        if first.shape[1] != second.shape[1]:
            raise _arrays.parameter_error(f"the source has {first.shape[1]} descriptors and the target {second.shape[1]}")
        known = first, second
    request = {
        "landmarks": [_arrays.vertex_list(pair, "landmarks")[0] for pair in listed],
        "signatures": bool(signatures),
        "start": start,
        "pairs": pairs,
        "step": _arrays.whole(step, "step"),
        "samples": _arrays.whole(samples, "samples"),
        "commutativity": float(commutativity),
        "all_points": bool(all_points),
        "both_ways": bool(both_ways),
    }
    matrix, there, back, qualities = _native.functional_map(source._core, target._core, json.dumps(request), known)
    return FunctionalMap(matrix, PointMap(*there), None if back is None else PointMap(*back), **dict(qualities))


@dataclass(frozen=True, eq=False)
class CollectionMap:
    """The map from one shape of a collection to another.

    Attributes
    ----------
    source, target : int
        The places of the shape where functions come from, and of that where they go to.
    matrix : numpy.ndarray, (k, k)
        ``C``: takes coefficients on the source to coefficients on the target, both surfaces scaled to unit area.
    to_source : PointMap
        For all vertices of the target those of the source.
    disagreement : float
        How far the map that the points of this pair alone made was from what the collection agrees on.
    """

    source: int
    target: int
    matrix: np.ndarray
    to_source: PointMap
    disagreement: float


@dataclass(frozen=True, eq=False)
class MapCollection:
    """Maps between all shapes of a collection, both ways.

    Attributes
    ----------
    maps : dict of (int, int) to CollectionMap
        By the places of source and target.
    pairs_error : float
        The mean distance, over the root of the area, between a vertex and where the maps there and back lead it.
    triples_error : float or None
        The same for walks over two other shapes; None for two shapes.
    largest_error : float
        The largest mean of a single walk.
    """

    maps: dict[tuple[int, int], CollectionMap]
    pairs_error: float
    triples_error: float | None
    largest_error: float

    @classmethod
    def _of_npz(cls, arrays: Any) -> MapCollection:
        """From the members of a stored file: points are those of the files that the shapes came from, where their numbering is known."""
        shapes = range(len(arrays["vertices"]))
        files = [arrays[f"vertex_map_{shape}"].astype(np.int64) if f"vertex_map_{shape}" in arrays else None for shape in shapes]
        maps = {}
        for source in shapes:
            for target in shapes:
                if source == target:
                    continue
                points = arrays[f"points_{source}_{target}"].astype(np.int64)
                confidences = arrays[f"confidences_{source}_{target}"]
                onto, of_file = files[source], files[target]
                if onto is not None:
                    # Where several vertices of a file became one, the first stands for it.
                    numbers = np.full(int(arrays["vertices"][source]), -1)
                    kept = np.flatnonzero(onto >= 0)[::-1]
                    numbers[onto[kept]] = kept
                    points = numbers[points]
                if of_file is not None:
                    points = np.where(of_file >= 0, points[of_file], -1)
                    confidences = np.where(of_file >= 0, confidences[of_file], np.nan)
                matrix, gap = arrays[f"matrix_{source}_{target}"], float(arrays["disagreements"][source, target])
                maps[source, target] = CollectionMap(source, target, matrix, PointMap(None, points, confidences), gap)
        cycles = json.loads(bytes(arrays["report"]))["cycles"]
        return cls(maps, cycles["pairs"], cycles["triples"], cycles["largest"])


def collection_request(
    *,
    start: int | None = None,
    pairs: int | None = None,
    step: int = 5,
    samples: int = 2000,
    oriented: bool = True,
    polish: bool = True,
) -> dict[str, Any]:
    """The parameters of maps of a collection, as they are asked for by the library and by a server."""
    return {
        "start": start,
        "pairs": pairs,
        "step": _arrays.whole(step, "step"),
        "samples": _arrays.whole(samples, "samples"),
        "oriented": bool(oriented),
        "polish": bool(polish),
    }


def map_collection(
    bases: Sequence[Basis],
    *,
    start: int | None = None,
    pairs: int | None = None,
    step: int = 5,
    samples: int = 2000,
    oriented: bool = True,
    polish: bool = True,
    progress: bool | Callable[[str, float], Any] = False,
) -> MapCollection:
    """Map all shapes of a collection to each other, without landmarks.

    First maps follow from wave kernel signatures and the orientation of the surfaces (Ren et al. 2018), are refined by ZoomOut, and made consistent by a
    latent basis that all shapes have in common (Huang et al. 2020). Shapes are taken to be nearly isometric.

    Parameters
    ----------
    bases : sequence of Basis
        Bases of the shapes, 2 to 32, with their meshes.
    start, pairs, step : int
        The size of the first maps (30), of the refined ones (100 or what all bases have), and by how much they grow at once.
    samples : int
        Vertices of each surface that stand for it meanwhile.
    oriented : bool
        Whether maps keep the orientation that the faces give. Without it nothing tells the sides of a symmetric shape apart.
    polish : bool
        Whether each pair is refined by itself at the end: nearer to the truth, and a little less consistent.
    progress : bool or callable
        Draw a bar (where tqdm is installed), or call with the stage and the fraction of it that is done.

    Returns
    -------
    MapCollection

    Examples
    --------
    >>> import chladni, numpy
    >>> mesh = chladni.Mesh.sample("knot", 1500)
    >>> bent = [chladni.Mesh(mesh.vertices * [1.0, 1.0, scale], mesh.faces) for scale in (1.0, 1.02, 1.05)]
    >>> found = chladni.map_collection([chladni.eigs(one, k=50) for one in bent], pairs=50)
    >>> len(found.maps), found.maps[0, 2].to_source.points.shape
    (6, (1500,))
    """
    request = collection_request(start=start, pairs=pairs, step=step, samples=samples, oriented=oriented, polish=polish)
    told, close = _arrays.progress_callback(progress)
    try:
        maps, there, around, largest = _native.map_collection([basis._core for basis in bases], json.dumps(request), told)
    finally:
        close()
    made = [CollectionMap(source, target, matrix, PointMap(*points), gap) for source, target, matrix, points, gap in maps]
    return MapCollection({(one.source, one.target): one for one in made}, there, around, largest)
