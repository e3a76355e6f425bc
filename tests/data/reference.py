"""Reference eigenvalues of real meshes, computed by SciPy: `python reference.py MESH_FOLDER FILE...` writes reference/FILE.txt.

The lowest 505 eigenvalues of S x = l M x on the mesh scaled to unit area, cotangent S, barycentric M, by shift-invert Lanczos
with tolerance 1e-8. Reads OBJ and binary little-endian PLY of triangles.
"""
import os
import sys

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sl


def read(path):
    if path.endswith(".obj"):
        positions, faces = [], []
        for line in open(path):
            words = line.split()
            if words[:1] == ["v"]:
                positions.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:4]])
        return np.array(positions), np.array(faces)
    raw = open(path, "rb").read()
    end = raw.index(b"end_header\n") + 11
    counts = {line.split()[1]: int(line.split()[2]) for line in raw[:end].decode().splitlines() if line.startswith("element")}
    floats = np.frombuffer(raw, "<f4", 3 * counts["vertex"], end).reshape(-1, 3).astype(float)
    rows = np.frombuffer(raw, np.dtype([("k", "u1"), ("v", "<i4", 3)]), counts["face"], end + 12 * counts["vertex"])
    return floats, rows["v"].astype(int)


def pencil(positions, faces):
    used, faces = np.unique(faces, return_inverse=True)
    positions, faces = positions[used], faces.reshape(-1, 3)
    n = len(positions)
    corners = positions[faces]
    double = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rows, columns, values = [], [], []
    for k in range(3):
        i, j = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        weight = (u * v).sum(1) / double / 2
        rows += [i, j, i, j]
        columns += [j, i, i, j]
        values += [-weight, -weight, weight, weight]
    stiffness = sp.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))
    mass = np.bincount(faces.ravel(), np.repeat(double / 6, 3), n) / (double.sum() / 2)
    return stiffness, sp.diags(mass).tocsc()


if __name__ == "__main__":
    folder, here = sys.argv[1], os.path.dirname(os.path.abspath(__file__))
    for name in sys.argv[2:]:
        stiffness, mass = pencil(*read(os.path.join(folder, name)))
        values = np.sort(sl.eigsh(stiffness, k=505, M=mass, sigma=-0.01, tol=1e-8, return_eigenvectors=False))
        header = f"505 lowest eigenvalues, unit area, barycentric mass: tests/data/reference.py {name}"
        np.savetxt(os.path.join(here, "reference", name + ".txt"), values, fmt="%.10g", header=header)
