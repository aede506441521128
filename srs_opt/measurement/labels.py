"""Which position belongs to which link, frame by frame: swapped labels, ghosts, loose markers.

Positions are followed from a frame whose order is known: each link takes the position nearest to where it was
last seen (carried along with the links that are seen). Labels are not trusted at all, so it does not matter
how often they swap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.measurement.chain import Chain
from srs_opt.measurement.find_chain import find_chain
from srs_opt.measurement.records import Array
from srs_opt.measurement.take_settings import LABELS


@dataclass(frozen=True, eq=False)
class CorrectedLabels:
    """Markers with their labels put right.

    Attributes
    ----------
    markers_m : ndarray, shape (T, M, 2)
    swapped : ndarray of bool, shape (T,)
        Frames whose labels were permuted.
    dropped : ndarray of bool, shape (T, M)
        Positions (by their old label) that fit no link, reflections for instance, and were taken out.
    """

    markers_m: Array
    swapped: np.ndarray
    dropped: np.ndarray


def correct_labels(chain: Chain, markers_m: Array) -> CorrectedLabels:
    """Put right labels that are exchanged in some frames; take out positions that fit no link.

    Parameters
    ----------
    chain : Chain
    markers_m : ndarray, shape (T, M, 2)
        Tail to head, NaN where lost. The first frame that shows most markers must be in order.
    """
    points = np.asarray(markers_m, dtype=float)
    unchanged = np.zeros(len(points), dtype=bool), np.zeros(points.shape[:2], dtype=bool)
    if not _suspicious(chain, points):
        return CorrectedLabels(points, *unchanged)
    counts = np.isfinite(points[..., 0]).sum(axis=1)
    start = next((k for k in np.flatnonzero(counts == counts.max()) if fits_chain(chain, points[k])), None)
    if start is None:
        return CorrectedLabels(points, *unchanged)
    owners = follow(chain, points, int(start), np.arange(chain.markers))
    mended = take(points, owners)
    own = np.arange(chain.markers)
    swapped = ((owners >= 0) & (owners != own)).any(axis=1)
    used = (owners[:, :, None] == own).any(axis=1)
    return CorrectedLabels(mended, swapped, np.isfinite(points[..., 0]) & ~used)


def _suspicious(chain: Chain, points: Array) -> bool:
    """Whether any marker jumps between sightings, as those do whose labels are exchanged in some frames."""
    for marker in range(points.shape[1]):
        seen = points[np.isfinite(points[:, marker, 0]), marker]
        jumps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
        if (jumps > LABELS.near_pitch * chain.pitch_m).any():
            return True
    return False


def fits_chain(chain: Chain, frame: Array) -> bool:
    """Whether no two seen markers lie farther apart than the chain between them is long."""
    return bool(np.all(_stretch(chain, frame)[1] <= LABELS.slack))


def _stretch(chain: Chain, frame: Array) -> tuple[np.ndarray, Array]:
    """Return the markers seen, and how far each lies from the next, over their distance when straight."""
    seen = np.flatnonzero(np.isfinite(frame[:, 0]))
    chords = np.linalg.norm(np.diff(frame[seen], axis=0), axis=1)
    return seen, chords / np.linalg.norm(np.diff(chain.straight_m[seen], axis=0), axis=1)


def take(cloud: Array, owners: np.ndarray) -> Array:
    """Return the links' positions, shape (T, M, 2), given which position each link owns (-1: none)."""
    frames = np.arange(len(cloud))[:, None]
    # position 0 stands in where there is none, and is masked next
    positions = cloud[frames, np.maximum(owners, 0)]
    return np.where((owners >= 0)[..., None], positions, np.nan)


def follow(chain: Chain, cloud: Array, start: int, order: np.ndarray) -> np.ndarray:
    """Follow the links through all frames, forwards and backwards from `start`.

    Parameters
    ----------
    chain : Chain
    cloud : ndarray, shape (T, P, 2)
        All positions seen, in any order; NaN where there is none.
    start : int
        Frame in which link i owns position ``order[i]`` (-1: not seen there).
    order : ndarray of int, shape (M,)

    Returns
    -------
    owners : ndarray of int, shape (T, M)
        Position that each link owns in each frame, -1 where it was lost.
    """
    owners = np.full((len(cloud), chain.markers), -1)
    owners[start] = np.where(np.isfinite(cloud[start, np.maximum(order, 0), 0]), order, -1)
    first = take(cloud[start : start + 1], owners[start : start + 1])[0]
    for frames in (range(start + 1, len(cloud)), range(start - 1, -1, -1)):
        # a link that the first frame does not show is looked for in a wider circle
        last, age = first.copy(), np.where(np.isfinite(first[:, 0]), 0, 10)
        for frame in frames:
            owners[frame] = _found_again(chain, cloud[frame], last, age)
            if (owners[frame] < 0).any():
                owners[frame] = _assign(chain, cloud[frame], last, age)
            _carry(last, age, cloud[frame], owners[frame])
    return owners


def _found_again(chain: Chain, positions: Array, last: Array, age: np.ndarray) -> np.ndarray:
    """Find the whole chain anew after frames in which it was lost: it has moved on, by a link perhaps."""
    known = np.isfinite(last[:, 0])
    if (
        age.min() < LABELS.lost_frames
        or np.isfinite(positions[:, 0]).sum() < chain.markers
        or known.sum() < 2
    ):
        return np.full(chain.markers, -1)
    order = find_chain(chain, positions)
    if order is None:
        return np.full(chain.markers, -1)
    axis = last[known][-1] - last[known][0]
    return order if (positions[order[-1]] - positions[order[0]]) @ axis > 0 else order[::-1]


def _assign(chain: Chain, positions: Array, last: Array, age: np.ndarray) -> np.ndarray:
    from scipy.optimize import linear_sum_assignment

    seen = np.flatnonzero(np.isfinite(positions[:, 0]))
    known = np.flatnonzero(np.isfinite(last[:, 0]))
    owners = np.full(len(last), -1)
    if not len(seen) or not len(known):
        return owners
    distance = np.linalg.norm(positions[seen, None] - last[None, known], axis=2)
    gate = chain.pitch_m * np.minimum(LABELS.near_pitch * np.sqrt(1 + age[known] / 10), LABELS.farthest_pitch)
    # a distance beyond the gate costs a constant, so that it does not push others out of place
    cost = np.minimum(distance / gate, 1.0)
    rows, columns = linear_sum_assignment(cost)
    for row, column in zip(rows, columns):
        if distance[row, column] < gate[column]:
            owners[known[column]] = seen[row]
    return _without_strays(chain, positions, owners)


def _without_strays(chain: Chain, positions: Array, owners: np.ndarray) -> np.ndarray:
    """Take out the position that makes neighbours too far apart (a reflection close to a lost marker)."""
    links = np.where((owners >= 0)[:, None], positions[np.maximum(owners, 0)], np.nan)
    while not fits_chain(chain, links):
        seen, excess = _stretch(chain, links)
        if len(seen) < 3:
            break
        stretched = np.zeros(len(seen))
        stretched[:-1] += excess
        stretched[1:] += excess
        worst = seen[int(np.argmax(stretched))]
        links[worst], owners[worst] = np.nan, -1
    return owners


def _carry(last: Array, age: np.ndarray, positions: Array, owners: np.ndarray) -> None:
    """Note where links are now; move the lost ones along with the mean of the seen ones."""
    seen = owners >= 0
    now = positions[np.maximum(owners, 0)]
    both = seen & np.isfinite(last[:, 0])
    if both.any():
        last[~seen] += (now[both] - last[both]).mean(axis=0)
    last[seen] = now[seen]
    age[seen] = 0
    age[~seen] += 1
