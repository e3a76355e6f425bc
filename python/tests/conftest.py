"""Shapes, and a server, that several tests share."""

import os
import re
import signal
import subprocess

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


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """The address of a server of the tests' own, with an empty folder. Needs the binary, as ``CHLADNI_BINARY``."""
    binary = os.environ.get("CHLADNI_BINARY", "")
    if not os.path.exists(binary):
        pytest.skip("CHLADNI_BINARY names no binary of the service")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("CHLADNI_")}
    data = tmp_path_factory.mktemp("server") / "data"
    command = [binary, "serve", "--listen", "127.0.0.1:0", "--data", str(data), "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    address = None
    for line in process.stdout:
        if found := re.search(r"http://127\.0\.0\.1:\d+", line):
            address = found[0]
            break
    assert address, "the server did not say where it listens"
    yield address
    process.send_signal(signal.SIGKILL)
    process.wait()
