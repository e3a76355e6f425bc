"""A basis as a notebook shows it: its lowest modes on the surface, in a frame that needs nothing from elsewhere."""

from __future__ import annotations

import base64
import gzip
import html
import json
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from . import _native

if TYPE_CHECKING:
    from ._basis import Basis

#: Modes that are shown.
MODES = 20
#: Numbers that a notebook is given at most: they are kept in its file.
NUMBERS = 600_000


def frame(basis: Basis) -> str | None:
    """The viewer as HTML; None where there is no surface at hand, where it is too large for a notebook, or where the package was
    built without Node, which makes the viewer.

    Parameters
    ----------
    basis : Basis
        The basis.

    Returns
    -------
    str or None
        An ``iframe`` that holds everything.
    """
    mesh = basis.mesh
    rows, pairs = basis.shape
    if mesh is None or pairs == 0 or rows != len(mesh.vertices):
        return None
    modes = min(pairs, MODES, NUMBERS // max(rows, 1) - 6)
    script = _script()
    if modes < 1 or script is None:
        return None
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    # Vertices that no face uses have no place; where they are makes no difference.
    centre = (mesh.kept_vertices.min(axis=0) + mesh.kept_vertices.max(axis=0)) / 2
    used = np.where(np.isfinite(vertices), vertices, centre)
    surface = [np.array([len(used), len(faces)], dtype="<u4"), used.astype("<f4"), faces.astype("<u4")]
    report = mesh.report
    data = {
        "surface": _text(b"".join(part.tobytes() for part in surface)),
        "modes": _text(np.ascontiguousarray(np.nan_to_num(basis.lift(0, modes)).T).astype("<f4").tobytes()),
        "values": basis.values[:modes].tolist(),
        # The lowest that is no constant.
        "first": int(np.argmax(basis.values[:modes] > 1e-9 * max(float(basis.values[-1]), 1e-300))),
        "closed": bool(report["closed"] and report["manifold"] and report["orientable"] and report["components"] == 1),
    }
    page = files(__package__).joinpath("_view.html").read_text(encoding="utf-8")
    # The data last: base64 may spell anything, and their place is the first.
    page = page.replace("SCRIPT", script, 1).replace("DATA", json.dumps(data), 1)
    return (
        '<iframe sandbox="allow-scripts" title="Modes of the surface" style="width:100%;max-width:640px;height:420px;border:0" '
        f'srcdoc="{html.escape(page, quote=True)}"></iframe>'
    )


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


@lru_cache(maxsize=1)
def _script() -> str | None:
    """The page's viewer, packed: a notebook keeps it once for each basis that is shown."""
    script = _native.viewer()
    return None if script is None else _text(gzip.compress(script, mtime=0))
