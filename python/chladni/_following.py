"""Modes followed from one basis to another."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

__all__ = ["FollowedCluster", "Following"]


@dataclass(frozen=True, eq=False)
class FollowedCluster:
    """Modes that are followed together, since eigenvalues lie close together in one basis or the other.

    Attributes
    ----------
    modes : numpy.ndarray of int64, (c,)
        Modes of the reference, ascending.
    followers : numpy.ndarray of int64, (c,)
        Modes of the other basis, each at the place of the mode that it follows.
    rotation : numpy.ndarray, (c, c)
        The orthogonal matrix with the least ``‖Φ[:, modes] − Ψ[:, followers] @ rotation‖``.
    """

    modes: np.ndarray
    followers: np.ndarray
    rotation: np.ndarray


@dataclass(frozen=True, eq=False)
class Following:
    """Which modes of another basis follow those of a reference: what `Basis.follow` gives.

    Attributes
    ----------
    modes : numpy.ndarray of int64, (m,)
        For each mode of the reference that of the other basis; −1 where nothing follows, with an overlap below a half.
    signs : numpy.ndarray, (m,)
        1, or −1 where the function has the other sign. Within a cluster its rotation counts instead.
    overlaps : numpy.ndarray, (m,)
        The cosine of the angle between each function and what follows it; within a cluster after its rotation.
    sure : numpy.ndarray of bool, (m,)
        Whether it follows for sure: its square is at least 0.8, so that no other has more than half of the overlap.
    clusters : list of FollowedCluster
        Modes that are followed together.
    rotation : numpy.ndarray, (m, m)
        What turns functions of the other basis to those of the reference, all in one: column `i` of ``other.lift(0, m) @ rotation`` follows function `i`, and is
        zero where nothing does.
    """

    modes: np.ndarray
    signs: np.ndarray
    overlaps: np.ndarray
    sure: np.ndarray
    clusters: list[FollowedCluster]
    rotation: np.ndarray

    @classmethod
    def _of_json(cls, text: str) -> Following:
        found = json.loads(text)
        each = found["modes"]
        modes = np.array([-1 if one["mode"] is None else one["mode"] for one in each], dtype=np.int64)
        signs = np.array([one["sign"] for one in each], dtype=np.float64)
        followed = np.flatnonzero(modes >= 0)
        rotation = np.zeros((len(modes), len(modes)))
        rotation[modes[followed], followed] = signs[followed]
        clusters = []
        for cluster in found["clusters"]:
            own, others = (np.array(cluster[name], dtype=np.int64) for name in ("modes", "followers"))
            turned = np.array(cluster["rotation"]["values"], dtype=np.float64).reshape(len(own), len(own))
            rotation[np.ix_(others, own)] = turned * (modes[own] >= 0)
            clusters.append(FollowedCluster(own, others, turned))
        overlaps, sure = np.array([one["overlap"] for one in each]), np.array([one["sure"] for one in each], dtype=bool)
        return cls(modes, signs, overlaps, sure, clusters, rotation)
