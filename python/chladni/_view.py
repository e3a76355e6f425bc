"""A basis as a notebook shows it: its lowest modes on the surface, in a frame that needs nothing from elsewhere."""

from __future__ import annotations

import base64
import html
import json
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ._basis import Basis

#: Modes that are shown.
MODES = 20
#: Numbers that a notebook is given at most: they are kept in its file.
NUMBERS = 600_000


def frame(basis: Basis) -> str | None:
    """The viewer as HTML; None where there is no surface at hand, or where it is too large for a notebook.

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
    if modes < 1:
        return None
    centre = (mesh.kept_vertices.min(axis=0) + mesh.kept_vertices.max(axis=0)) / 2
    radius = np.linalg.norm(mesh.kept_vertices - centre, axis=1).max() or 1.0
    values = np.nan_to_num(basis.lift(0, modes))
    largest = np.abs(values).max(axis=0)
    values = values / np.where(largest > 0, largest, 1)
    used = np.where(np.isfinite(mesh.vertices), mesh.vertices, centre)
    data = {
        "positions": _text(((used - centre) / radius).astype("<f4")),
        "faces": _text(np.asarray(mesh.faces).astype("<u4")),
        "modes": _text(np.ascontiguousarray(values.T).astype("<f4")),
        "values": basis.values[:modes].tolist(),
        # The lowest that is no constant.
        "first": int(np.argmax(basis.values[:modes] > 1e-9 * max(float(basis.values[-1]), 1e-300))),
    }
    page = files(__package__).joinpath("_view.html").read_text(encoding="utf-8").replace("DATA", json.dumps(data), 1)
    return (
        '<iframe sandbox="allow-scripts" title="Modes of the surface" style="width:100%;max-width:640px;height:420px;border:0" '
        f'srcdoc="{html.escape(page, quote=True)}"></iframe>'
    )


def _text(array: np.ndarray) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")
