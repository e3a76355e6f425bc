"""Reference eigenvalues of real meshes, computed by SciPy: `python reference.py MESH_FOLDER [OPERATOR:]FILE...` writes
reference/FILE.txt, or reference/FILE.OPERATOR.txt.

The lowest 505 eigenvalues (105 of operators other than the Laplacian) of S x = l M x on the mesh scaled to unit area, cotangent S,
barycentric M, by shift-invert Lanczos with tolerance 1e-8. Operators: `dirichlet`; `hamiltonian-T`, S plus the potential T (k1^2 + k2^2);
`extrinsic-T` (thesis, eq. 2.13); `robust`, by the package robust_laplacian. Reads OBJ, OFF and binary little-endian PLY of triangles.
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
    if path.endswith(".off"):
        words = open(path).read().split()
        n, f = int(words[1]), int(words[2])
        positions = np.array(words[4 : 4 + 3 * n], float).reshape(n, 3)
        return positions, np.array(words[4 + 3 * n : 4 + 3 * n + 4 * f], int).reshape(f, 4)[:, 1:]
    raw = open(path, "rb").read()
    end = raw.index(b"end_header\n") + 11
    counts = {line.split()[1]: int(line.split()[2]) for line in raw[:end].decode().splitlines() if line.startswith("element")}
    floats = np.frombuffer(raw, "<f4", 3 * counts["vertex"], end).reshape(-1, 3).astype(float)
    rows = np.frombuffer(raw, np.dtype([("k", "u1"), ("v", "<i4", 3)]), counts["face"], end + 12 * counts["vertex"])
    return floats, rows["v"].astype(int)


def clean(positions, faces):
    """Without unused vertices and repeated faces."""
    first = np.argmin(faces, axis=1)
    turned = np.stack([np.take_along_axis(faces, ((first + k) % 3)[:, None], 1)[:, 0] for k in range(3)], 1)
    _, kept = np.unique(turned, axis=0, return_index=True)
    used, faces = np.unique(faces[np.sort(kept)], return_inverse=True)
    return positions[used], faces.reshape(-1, 3)


def pencil(positions, faces):
    """Stiffness and lumped mass on unit area."""
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


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def normals(positions, faces):
    """Area-weighted vertex normals, and face normals of twice the area's length."""
    corners = positions[faces]
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(positions)
    for k in range(3):
        np.add.at(sums, faces[:, k], own)
    return unit(sums), own


def squared_curvatures(positions, faces):
    """k1^2 + k2^2 at the vertices: Grinspun et al. 2006 on faces, turned into the planes of the vertices and averaged by area."""
    at_vertices, own = normals(positions, faces)
    area, n = np.linalg.norm(own, axis=1) / 2, unit(own)
    half_edges = {(f[k], f[(k + 1) % 3]): i for i, f in enumerate(faces.tolist()) for k in range(3)}
    middle, edges = [], []
    for k in range(3):
        i, j = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        edges.append(positions[j] - positions[i])
        across = [half_edges.get((b, a), f) for f, (a, b) in enumerate(zip(i.tolist(), j.tolist()))]
        middle.append(unit(n + n[across]))
    q = [2 * ((middle[(k + 1) % 3] - middle[(k + 2) % 3]) * edges[k]).sum(1) for k in range(3)]
    operator = np.zeros((len(faces), 3, 3))
    for k in range(3):
        t = np.cross(edges[k], n)
        operator += ((q[(k + 1) % 3] + q[(k + 2) % 3] - q[k]) / (8 * area**2))[:, None, None] * t[:, :, None] * t[:, None, :]
    sums, weights = np.zeros((len(positions), 3, 3)), np.zeros(len(positions))
    for k in range(3):
        to = at_vertices[faces[:, k]]
        side = np.sign((n * to).sum(1))
        axis, cosine = np.cross(side[:, None] * n, to), np.abs((n * to).sum(1))
        cross = np.zeros((len(faces), 3, 3))
        cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
        cross -= cross.transpose(0, 2, 1)
        turn = np.eye(3) + cross + cross @ cross / (1 + cosine)[:, None, None]
        np.add.at(sums, faces[:, k], (side * area)[:, None, None] * (turn @ operator @ turn.transpose(0, 2, 1)))
        np.add.at(weights, faces[:, k], area)
    return ((sums / weights[:, None, None]) ** 2).sum((1, 2)), area.sum()


def problem(operator, positions, faces):
    if operator == "robust":
        import robust_laplacian

        stiffness, mass = robust_laplacian.mesh_laplacian(positions, faces)
        return stiffness.tocsc(), (mass / mass.diagonal().sum()).tocsc()
    stiffness, mass = pencil(positions, faces)
    if operator == "dirichlet":
        edges = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        inside = np.setdiff1d(np.arange(len(positions)), edges[count == 1])
        return stiffness[inside][:, inside], mass[inside][:, inside]
    if operator.startswith("hamiltonian-"):
        squares, area = squared_curvatures(positions, faces)
        return stiffness + float(operator[12:]) * area * sp.diags(squares) @ mass, mass
    if operator.startswith("extrinsic-"):
        t, (vertex, _) = float(operator[10:]), normals(positions, faces)
        turned = sum(sp.diags(vertex[:, c]) @ stiffness @ sp.diags(vertex[:, c]) for c in range(3))
        return ((1 - t) * stiffness + t * turned).tocsc(), mass
    return stiffness, mass


if __name__ == "__main__":
    folder, here = sys.argv[1], os.path.dirname(os.path.abspath(__file__))
    for argument in sys.argv[2:]:
        operator, _, name = argument.rpartition(":")
        stiffness, mass = problem(operator, *clean(*read(os.path.join(folder, name))))
        count = 105 if operator else 505
        values = np.sort(sl.eigsh(stiffness.tocsc(), k=count, M=mass, sigma=-0.01, tol=1e-8, return_eigenvectors=False))
        header = f"{count} lowest eigenvalues, unit area, barycentric mass: crates/spectral/tests/data/reference.py {argument}"
        file = os.path.basename(name) + ("." + operator if operator else "") + ".txt"
        np.savetxt(os.path.join(here, "reference", file), values, fmt="%.10g", header=header)
