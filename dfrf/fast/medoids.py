"""k-medoids: a few frames that represent all of them."""

from __future__ import annotations

import numpy as np

MIN_GAIN = 1e-9  # of the mean distance: a smaller one is rounding


def medoids(distance: np.ndarray, count: int) -> list[int]:
    """Columns of a distance (F, C) that are nearest to all rows in the mean (k-medoids).

    One after the other is added, then exchanged for another as long as that helps (Kaufman and
    Rousseeuw 1990).
    """
    chosen: list[int] = []
    better = True
    while better:
        better = False
        for k in range(count):
            rest = distance[:, chosen[:k] + chosen[k + 1 :]].min(1, initial=np.inf)
            cost = np.minimum(rest[:, None], distance).mean(0)
            best = int(cost.argmin())
            if k == len(chosen):
                chosen.append(best)
            elif cost[best] < cost[chosen[k]] - MIN_GAIN:
                chosen[k] = best
            else:
                continue
            better = True
    return chosen
