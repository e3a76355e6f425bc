"""Stiffness and consistent mass of linear elements on a cube of tetrahedra, as `chladni eigsh` takes them.

    python3 benches/tetrahedra.py 67 FOLDER                # 67³ = 300,763 unknowns: FOLDER/S.npz, FOLDER/M.npz, FOLDER/cube.mesh
    /usr/bin/time -v chladni eigsh FOLDER/S.npz FOLDER/M.npz -n 200 --tolerance 1e-6 --json > pairs.json

Each small cube is divided into six tetrahedra around a diagonal. Edges of the cube are 1, 1.1 and 1.21 long, so that few eigenvalues are equal.
"""

import itertools
import pathlib
import sys

import numpy as np
import scipy.sparse


def cube(side):
    """Positions, (side³, 3), and tetrahedra, (6 (side − 1)³, 4)."""
    axis = np.arange(side)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = np.array([side * side, side, 1])
    corners = grid[(grid < side - 1).all(axis=1)] @ steps
    tetrahedra = []
    for order in itertools.permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(steps[list(order)])])
        tetrahedra.append(corners[:, None] + path)
    return grid / (side - 1) * [1, 1.1, 1.21], np.concatenate(tetrahedra)


def assemble(positions, tetrahedra):
    """Stiffness and mass in CSR."""
    p = positions[tetrahedra]
    edges = p[:, 1:] - p[:, :1]
    volume = abs(np.linalg.det(edges)) / 6
    inverse = np.linalg.inv(edges)
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2)
    local = np.einsum("t,tdi,tdj->tij", volume, gradients, gradients)
    mass = volume[:, None, None] * (np.ones((4, 4)) + np.eye(4)) / 20
    rows, columns = np.repeat(tetrahedra, 4, axis=1).ravel(), np.tile(tetrahedra, 4).ravel()
    shape = (len(positions),) * 2
    return [scipy.sparse.csr_matrix((values.ravel(), (rows, columns)), shape) for values in (local, mass)]


if __name__ == "__main__":
    side, folder = int(sys.argv[1]), pathlib.Path(sys.argv[2])
    positions, tetrahedra = cube(side)
    with open(folder / "cube.mesh", "w") as file:
        file.write(f"MeshVersionFormatted 2\nDimension 3\nVertices\n{len(positions)}\n")
        file.writelines("%.17g %.17g %.17g 0\n" % tuple(p) for p in positions)
        file.write(f"Tetrahedra\n{len(tetrahedra)}\n")
        file.writelines("%d %d %d %d 0\n" % tuple(corners + 1) for corners in tetrahedra)
        file.write("End\n")
    for name, matrix in zip("SM", assemble(positions, tetrahedra)):
        # Both triangles are the same to the last bit.
        matrix = (matrix + matrix.T) / 2
        scipy.sparse.save_npz(folder / f"{name}.npz", matrix, compressed=False)
        print(name, matrix.shape[0], matrix.nnz)
