#!/usr/bin/env python3
"""Frequencies of plates by four bending energies of triangle meshes, over the exact ones. Needs NumPy and SciPy; takes a few minutes.

A second construction of what `crates/spectral/src/operator/elastic/bending.rs` assembles ("shared"), beside those that it was chosen from:

- "face": the quadratic function through the corners of a face and the three apexes beyond its edges;
- "half": the angles of mid-edge normals, half of each dihedral angle;
- "Morley": the angles of mid-edge normals with one unknown of its own for each edge;
- "shared": these angles by a quadratic fit to five dihedral angles.

`bending.py 20`: ratios of the first and of the fourth frequency of a square plate of 20 cells, simply supported and clamped, bending alone. `bending.py long`: of a simply
supported plate of 20 cells across whose cells are 3 and 10 times as long as wide. `bending.py needles`: with needles.
"""
import sys

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
import scipy.spatial

POISSON, RIDGE, MOST = 0.3, 1e-6, 3.0
PLATE = np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, 2 * (1 - POISSON)]])


def plate(m, cells, n=None, seed=7):
    """Vertices and counterclockwise triangles of the unit square, in m × n cells."""
    random = np.random.default_rng(seed)
    n = n or m
    size = np.array([m, n])
    x, y = np.meshgrid(np.arange(m + 1.0), np.arange(n + 1.0), indexing="ij")
    points = np.stack([x, y], -1).reshape(-1, 2)
    inside = ((points > 0) & (points < size)).all(1)
    if cells in ("jittered", "delaunay"):
        points[inside] += random.uniform(-0.33, 0.33, (inside.sum(), 2))
    if cells == "delaunay":
        return triangulated(points / size)
    faces, middles = [], []
    for i in range(m):
        for j in range(n):
            p, q, r, s = i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1
            if cells == "crisscross":
                c = len(points) + len(middles)
                middles.append([i + 0.5, j + 0.5])
                faces += [[p, q, c], [q, r, c], [r, s, c], [s, p, c]]
                continue
            across = cells == "one way" or (cells == "alternating" and (i + j) % 2 == 1)
            if cells == "jittered":
                u, v, w, z = points[p] - points[q], points[r] - points[q], points[r] - points[s], points[p] - points[s]
                across = u @ v / np.linalg.norm(u) / np.linalg.norm(v) + w @ z / np.linalg.norm(w) / np.linalg.norm(z) > 0
            faces += [[p, q, r], [p, r, s]] if across else [[p, q, s], [q, r, s]]
    if middles:
        points = np.concatenate([points, middles])
    return points / size, np.array(faces)


def with_needles(p, faces):
    """A further vertex in every seventh face, next to one of its edges: it leaves a cap and two needles."""
    random = np.random.default_rng(3)
    p, all_faces = [list(x) for x in p], []
    for f, (a, b, c) in enumerate(faces):
        if f % 7 != 3:
            all_faces.append([a, b, c])
            continue
        share, near = 0.5 + 0.4 * random.uniform(-1, 1), 10 ** random.uniform(-3, -1)
        on = (1 - share) * np.array(p[a]) + share * np.array(p[b])
        p.append(list(on + near * (np.array(p[c]) - on)))
        n = len(p) - 1
        all_faces += [[a, b, n], [b, c, n], [c, a, n]]
    return np.array(p), np.array(all_faces)


def with_a_fan(m):
    """What is within .2 of the middle is a fan of needles."""
    p, faces = plate(m, "one way")
    kept = [tuple(f) for f in faces if np.linalg.norm(p[f] - 0.5, axis=1).min() > 0.2]
    edges = {(f[k], f[k - 2]) for f in kept for k in range(3)}
    inner = {v for v in range(len(p)) if (np.abs(p[v] - 0.5) < 0.499).all()}
    fan = [(b, a, len(p)) for a, b in edges if (b, a) not in edges and (a in inner or b in inner)]
    faces = np.array(kept + fan)
    p = np.concatenate([p, [[0.5, 0.5]]])
    used, faces = np.unique(faces, return_inverse=True)
    return p[used], faces.reshape(-1, 3)


def at_random(n, seed):
    random = np.random.default_rng(seed)
    side = np.linspace(0, 1, int(np.sqrt(n)) + 1)
    border = [(0, t) for t in side] + [(1, t) for t in side] + [(t, 0) for t in side[1:-1]] + [(t, 1) for t in side[1:-1]]
    return triangulated(np.array(border + list(random.uniform(0.01, 0.99, (n, 2)))))


def triangulated(points):
    faces = scipy.spatial.Delaunay(points).simplices
    u, v = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    doubled = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    faces[doubled < 0] = faces[doubled < 0][:, ::-1]
    return points, faces[np.abs(doubled) > 1e-12]


def rise(p, edge, apex):
    """How far the apex of a face is above the linear function through the ends of its edge, over its distance: weights of the three heights."""
    (a, b), c = edge, apex
    e = p[b] - p[a]
    square = e @ e
    foot = (p[c] - p[a]) @ e / square
    height = abs(e[0] * (p[c] - p[a])[1] - e[1] * (p[c] - p[a])[0]) / np.sqrt(square)
    return {a: -(1 - foot) / height, b: -foot / height, c: 1 / height}


def plus(*rows):
    total = {}
    for factor, row in rows:
        for v, x in row.items():
            total[v] = total.get(v, 0.0) + factor * x
    return total


def stiffness(p, faces, energy, clamped):
    """The stiffness of heights, and of further unknowns with "Morley", for a rigidity of 1; and the mass."""
    n = len(p)
    edges = {}
    for f, face in enumerate(faces):
        for k in range(3):
            edges.setdefault(frozenset((face[k - 2], face[k - 1])), []).append((f, k))
    number = {edge: n + at for at, edge in enumerate(edges)}
    quadratic = np.stack([p[:, 0] ** 2 / 2, p[:, 1] ** 2 / 2, p[:, 0] * p[:, 1]], -1)

    def value(row):
        return sum(x * quadratic[v] for v, x in row.items())

    own, hinge = {}, {}
    for edge, sides in edges.items():
        for f, k in sides:
            face = faces[f]
            own[f, k] = rise(p, (face[k - 2], face[k - 1]), face[k])
            if clamped is not None and all(clamped[v] for v in edge):
                hinge[f, k] = None
        if len(sides) == 2 and sides[0] not in hinge:
            hinge[sides[0]] = hinge[sides[1]] = plus((1, own[sides[0]]), (1, own[sides[1]]))
    size = n + (len(edges) if energy == "Morley" else 0)
    rows, columns, entries, mass = [], [], [], np.zeros(size)
    for f, face in enumerate(faces):
        e = [p[face[k - 1]] - p[face[k - 2]] for k in range(3)]
        area = 0.5 * abs(e[0][0] * e[1][1] - e[0][1] * e[1][0])
        mass[face] += area / 3
        angles, tensors = [], []
        for k in range(3):
            length = np.linalg.norm(e[k])
            normal = np.array([e[k][1], -e[k][0]]) / length
            tensors.append(length / area * np.array([normal[0] ** 2, normal[1] ** 2, normal[0] * normal[1]]))
            edge = frozenset((face[k - 2], face[k - 1]))
            known = hinge.get((f, k), False)
            # Of the mid-edge normal: a height that rises to the inside on one side falls on the other.
            sign = 1.0 if edges[edge][0] == (f, k) else -1.0
            if known is None or energy == "Morley":
                angles.append(own[f, k] if known is None else plus((1, own[f, k]), (sign, {number[edge]: 1.0})))
            elif known is False:
                angles.append(None)
            elif energy == "shared":
                other = next(side for side in edges[edge] if side != (f, k))
                data = [known]
                for g, m in ((f, k), other):
                    for step in (1, 2):
                        row = hinge.get((g, (m + step) % 3), False)
                        if row is not False:
                            data.append(level(p, own[g, (m + step) % 3], faces[g], (m + step) % 3) if row is None else row)
                fit = np.array([curved(p, quadratic, row) for row in data])
                square = fit.T @ fit
                target = 0.5 * (at_middle(p, own[f, k], edge) - at_middle(p, own[other], edge))
                weights = fit @ np.linalg.solve(square + RIDGE * (square[0, 0] + square[1, 1] + 0.5 * square[2, 2]) * PLATE, target)
                # What displacements do to the five angles, and to the own one: shares that amplify are cut.
                amplified = [sum(x * x for x in row.values()) for row in data]
                most = np.sqrt(amplified[0] / max(weights**2 @ amplified, 1e-300))
                weights = weights * min(1.0, MOST * most)
                angles.append(plus((0.5, known), *[(w, bare(row)) for w, row in zip(weights, data)]))
            else:
                angles.append(plus((0.5, known)))
        tensors = np.array(tensors).T
        if energy == "face" and all(a is not None for a in angles):
            full = [plus((2, own[f, k])) if hinge[f, k] is None else hinge[f, k] for k in range(3)]
            fit = np.array([2 * at_middle(p, own[f, k], (face[k - 2], face[k - 1])) if hinge[f, k] is None else value(full[k]) for k in range(3)])
            if np.linalg.norm(fit) * np.linalg.norm(np.linalg.inv(fit)) <= 40 if abs(np.linalg.det(fit)) > 1e-14 else False:
                angles, tensors = full, np.linalg.inv(fit)
        q = area * tensors.T @ PLATE @ tensors
        for k in range(3):
            if angles[k] is None:
                if q[k, k] > 0:
                    q = q - np.outer(q[k], q[k]) / q[k, k]
                q[k] = q[:, k] = 0
                angles[k] = {}
        places = sorted(set().union(*angles))
        r = np.array([[a.get(v, 0.0) for v in places] for a in angles])
        block = r.T @ q @ r
        rows.append(np.repeat(places, len(places)))
        columns.append(np.tile(places, len(places)))
        entries.append(block.ravel())
    return sp.csr_matrix((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), (size, size)), mass


class Bent(dict):
    """An angle at a clamp: its value for a quadratic function is that beside the slope at the midpoint of the edge."""


def level(p, row, face, k):
    bent = Bent(row)
    bent.edge = (face[k - 2], face[k - 1])
    return bent


def bare(row):
    return dict(row)


def curved(p, quadratic, row):
    if isinstance(row, Bent):
        return at_middle(p, row, row.edge)
    return sum(x * quadratic[v] for v, x in row.items())


def at_middle(p, row, edge):
    """The angle for quadratic functions that are level at the midpoint of the edge."""
    a, b = tuple(edge)
    q = p - 0.5 * (p[a] + p[b])
    return sum(x * np.array([q[v, 0] ** 2 / 2, q[v, 1] ** 2 / 2, q[v, 0] * q[v, 1]]) for v, x in row.items())


def ratios(p, faces, energy, rotations):
    border = (np.abs(p - 0.5) > 0.5 - 1e-9).any(1)
    k, mass = stiffness(p, faces, energy, border if rotations else None)
    kept = np.ones(len(mass), bool)
    kept[: len(p)] = ~border
    if energy == "Morley":
        # Morley's edges on the border: clamped ones have no unknown of theirs, so their rows are empty.
        kept &= k.diagonal() > 0
    k, mass = k[kept][:, kept].tocsc(), mass[kept]
    lu = sla.splu(k)
    solve = sla.LinearOperator(k.shape, matvec=lambda x: lu.solve(mass * x), dtype=float)
    values = np.sort(1 / np.sort(sla.eigs(solve, 4, return_eigenvectors=False).real)[::-1])
    numbers = [35.985, 73.394, 73.394, 108.217] if rotations else np.pi**2 * np.array([2, 5, 5, 8])
    return np.sqrt(values) / numbers


if __name__ == "__main__":
    if sys.argv[1:] == ["long"]:
        for across in (3, 10):
            for cells in ("one way", "alternating", "crisscross", "delaunay"):
                p, faces = plate(20, cells, 20 * across)
                found = {energy: ratios(p, faces, energy, False) for energy in ("half", "shared")}
                print(across, cells, {e: f"{r[0]:.4f} {r[3]:.4f}" for e, r in found.items()}, flush=True)
        sys.exit()
    if sys.argv[1:] == ["needles"]:
        for name, (p, faces) in {
            "caps, 20 cells": with_needles(*plate(20, "jittered")),
            "caps, 40 cells": with_needles(*plate(40, "jittered")),
            "fan, 40 cells": with_a_fan(40),
            "1,200 points": at_random(1200, 2),
            "4,800 points": at_random(4800, 4),
        }.items():
            found = {energy: ratios(p, faces, energy, False) for energy in ("face", "half", "shared")}
            print(name, {e: f"{r[0]:.4f} {r[3]:.4f}" for e, r in found.items()}, flush=True)
        sys.exit()
    m = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for rotations in (False, True):
        for cells in ("one way", "alternating", "crisscross", "jittered"):
            p, faces = plate(m, cells)
            found = {energy: ratios(p, faces, energy, rotations) for energy in ("face", "half", "Morley", "shared")}
            print("clamped" if rotations else "supported", cells, {e: f"{r[0]:.4f} {r[3]:.4f}" for e, r in found.items()}, flush=True)
