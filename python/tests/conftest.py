"""Shapes that several tests share."""

import numpy as np
import pytest

import chladni


def torus_grid(rings: int, around: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of a periodic grid, and the parameters of its vertices in [0, 1)²."""
    i, j = np.meshgrid(np.arange(rings), np.arange(around), indexing="ij")
    number = lambda a, b: (a % rings) * around + (b % around)  # noqa: E731
    a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return np.stack([i / rings, j / around], -1).reshape(-1, 2), faces


def cube(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """The surface of the unit cube, each side cut into cells × cells squares of two triangles."""
    numbers: dict[tuple[int, int, int], int] = {}
    faces = []
    for axis in range(3):
        for side in (0, cells):
            for u in range(cells):
                for v in range(cells):
                    corners = []
                    for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        place = [0, 0, 0]
                        place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3] = side, u + du, v + dv
                        corners.append(numbers.setdefault(tuple(place), len(numbers)))
                    if side == 0:
                        corners.reverse()
                    a, b, c, d = corners
                    faces += [[a, b, c], [a, c, d]]
    return np.array(list(numbers), dtype=float) / cells, np.array(faces)


@pytest.fixture(scope="session")
def sphere() -> chladni.Mesh:
    return chladni.Mesh.sample("sphere", 2562)


@pytest.fixture(scope="session")
def knot() -> chladni.Mesh:
    return chladni.Mesh.sample("knot", 3000)


@pytest.fixture(scope="session")
def knot_basis(knot: chladni.Mesh) -> chladni.Basis:
    return chladni.eigs(knot, k=40, method="hsim")
