"""Three simpler ways to name an effect, on the same linearised data: what the workflow has to beat."""

from __future__ import annotations

import numpy as np

from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.objective import priors, sum_eliminated
from srs_opt.discrepancy.pipeline import Discrepancy

NO_SHAPE = 0.3  # correlation below which the nearest shape is no shape
THRESHOLD = 0.15  # of typical size, for sparse regression


def baselines(found: Discrepancy) -> dict[str, list[str]]:
    """Return the names that each method gives (empty: none)."""
    if found.null is None or found.experiment is None:
        return {}
    lin = found.null.linearisation
    fitted = lin.coordinates[: lin.fitted]
    others = lin.coordinates[lin.fitted :]
    start = Point({**start_point(fitted).values, **{c.name: 0.0 for c in others}})
    bench = found.experiment.normal_equations(start, lin.coordinates, found.split.open)
    raw = np.sum([g.raw for g in bench.values()], axis=0)
    return {
        "nearest_shape": _nearest(raw, lin),
        "forward_aic": _forward(found),
        "sparse_regression": _sparse(raw, lin),
    }


def _nearest(raw: np.ndarray, lin) -> list[str]:  # type: ignore[no-untyped-def]
    """Return the effect whose slope correlates most with the residual at the bench values."""
    size = np.sqrt(np.maximum(np.diag(raw), 1e-300))
    cosine = np.abs(raw[-1, lin.fitted : -1]) / size[lin.fitted : -1] / size[-1]
    best = int(np.argmax(cosine))
    return [lin.coordinates[lin.fitted + best].effect] if cosine[best] > NO_SHAPE else []


def _forward(found: Discrepancy) -> list[str]:
    """Add effects one by one to the calibrated, linearised model while Akaike's criterion falls."""
    assert found.null is not None
    lin = found.null.linearisation
    size = len(lin.coordinates)
    index = [*range(size), next(iter(lin.equations.values())).raw.shape[0] - 1]
    total = sum_eliminated(lin.equations)[np.ix_(index, index)]
    precision, offset = priors(lin.coordinates, lin.point)
    total[np.arange(size), np.arange(size)] += precision
    total[:size, -1] -= precision * offset
    total[-1, :size] = total[:size, -1]
    chosen, names = list(range(lin.fitted)), []
    deviance = _deviance(total, chosen)
    for _ in range(5):
        free = [k for k in range(lin.fitted, size) if k not in chosen]
        if not free:
            break
        trials = [(_deviance(total, [*chosen, k]), k) for k in free]
        best, k = min(trials)
        if deviance - best < 2:
            break
        chosen.append(k)
        names.append(lin.coordinates[k].effect)
        deviance = best
    return sorted(set(names))


def _deviance(total: np.ndarray, chosen: list[int]) -> float:
    a, g = total[np.ix_(chosen, chosen)], total[chosen, -1]
    return float(total[-1, -1] - g @ np.linalg.lstsq(a, g, rcond=None)[0])


def _sparse(raw: np.ndarray, lin) -> list[str]:  # type: ignore[no-untyped-def]
    """Sequentially thresholded least squares on the residual at the bench values."""
    typical = np.array([c.typical for c in lin.coordinates])
    chosen = list(range(len(lin.coordinates)))
    for _ in range(10):
        a = raw[np.ix_(chosen, chosen)]
        sizes = np.linalg.lstsq(a, raw[chosen, -1], rcond=None)[0] / typical[chosen]
        kept = [k for k, s in zip(chosen, sizes) if k < lin.fitted or abs(s) > THRESHOLD]
        if kept == chosen:
            break
        chosen = kept
    return sorted({lin.coordinates[k].effect for k in chosen if k >= lin.fitted})
