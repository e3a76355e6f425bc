"""The same vertices and surface with other triangles: a share of the edges is flipped."""

import numpy as np


def flipped(vertices, faces, share, seed):
    """Faces after so many of the edges were flipped, no two of them around one face: those whose two faces lie within 30° of one plane and make a convex quadrangle
    without angles below 10°, and whose new edge is not there yet."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    of = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, of = edges[order], of[order]
    first = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    there = set(map(tuple, edges.tolist()))
    faces, touched = faces.copy(), np.zeros(len(faces), dtype=bool)
    wanted, made = int(share * len(first)), 0
    for at in np.random.default_rng(seed).permutation(first):
        if made == wanted:
            break
        one, other = of[at], of[at + 1]
        if touched[one] or touched[other]:
            continue
        a, b = edges[at]
        c, d = (int(faces[face].sum() - a - b) for face in (one, other))
        if (min(c, d), max(c, d)) in there:
            continue
        # Turn the first face so that it runs a, b, c.
        if not any((np.roll(faces[one], k) == (a, b, c)).all() for k in range(3)):
            a, b = b, a
        new = np.array([[c, a, d], [d, b, c]])
        if not fair(vertices, faces[[one, other]], new):
            continue
        faces[one], faces[other] = new
        touched[[one, other]] = True
        there.add((min(c, d), max(c, d)))
        made += 1
    return faces, made


def normals(vertices, faces):
    p = vertices[faces]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def fair(vertices, old, new):
    before, after = normals(vertices, old), normals(vertices, new)
    if before[0] @ before[1] < np.cos(np.radians(30)) or (before @ after.T).min() < np.cos(np.radians(30)):
        return False
    p = vertices[new]
    for k in range(3):
        u, v = p[:, (k + 1) % 3] - p[:, k], p[:, (k + 2) % 3] - p[:, k]
        cosine = np.einsum("ij,ij->i", u, v) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
        if cosine.max() > np.cos(np.radians(10)):
            return False
    return True
