"""Where the covariance of a fit says nothing of a joint's friction, one that does.

Eq. 16 has two levels with a steepness each. Where both steepnesses come out alike, the levels make up for
each other: their variances are 1e12 times those of the friction at any velocity, and the inverse of the
normal equations has lost all digits of the latter (some come out negative). The friction itself is known as
ever. Its covariance is then made anew of the same columns along the logs, by a pseudo-inverse that leaves out
what they do not tell, as of white noise, of a size that gives viscous friction the variance that it had.
On fits without this fault, variances made so are 0.98 of those of `identify` in the median (80 % of them: 0.7
to 1.3).
"""

from __future__ import annotations

from typing import Any, Dict, List, Tuple

import numpy as np

from .._arrays import Array

Json = Dict[str, Any]

#: Smallest over largest eigenvalue below which the smaller ones of a matrix of doubles are its errors.
_LEAST = 1e-11

#: The viscous coefficient is the third of a joint's five.
_VISCOUS = 2


def repaired(covariance: Json) -> Tuple[Json, List[int]]:
    """covariance.json, and the joints of which it was made anew."""
    first, joints = len(covariance["parameters"]), []
    rows = [list(row) for row in covariance["covariance"]]
    whole = _full(rows)
    for joint, path in enumerate(covariance["path"], 1):
        own = list(range(first + 5 * (joint - 1), first + 5 * joint))
        values = np.linalg.eigvalsh(whole[np.ix_(own, own)])
        if not all(c in path["columns"] for c in own) or values[0] > _LEAST * values[-1]:
            continue
        block = _made_anew(path, own, whole[own[_VISCOUS], own[_VISCOUS]])
        if block is None:
            continue
        joints.append(joint)
        for a in own:
            for b in range(len(rows)):
                if b not in own and a != own[_VISCOUS]:
                    rows[max(a, b)][min(a, b)] = 0.0
        for i, a in enumerate(own):
            for k, b in enumerate(own[: i + 1]):
                rows[a][b] = float(block[i, k])
    return ({**covariance, "covariance": rows} if joints else covariance), joints


def _made_anew(path: Json, own: List[int], viscous: float) -> Any:
    """The covariance of a joint's friction of the products of its columns; None where it has no size."""
    gram = _full(path["products"])
    size = 1.0 / np.sqrt(np.diag(gram))
    scale = np.outer(size, size)
    inverse = np.linalg.pinv(gram * scale, rcond=1e-10, hermitian=True) * scale
    at = [path["columns"].index(c) for c in own]
    block = inverse[np.ix_(at, at)]
    own_variance = block[_VISCOUS, _VISCOUS]
    return block * (viscous / own_variance) if viscous > 0 and own_variance > 0 else None


def _full(triangle: List[List[float]]) -> Array:
    """A symmetric matrix of its lower triangle."""
    full = np.zeros((len(triangle), len(triangle)))
    for k, row in enumerate(triangle):
        full[k, : k + 1] = full[: k + 1, k] = row
    return full
