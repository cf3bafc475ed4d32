"""Weights of closeness' parts, fitted to answers.

A answers, P parts. Bradley and Terry (1952): the odds of preferring one dub to another are the
ratio of their strengths. Here the logarithm of a strength is a weighted sum of the logarithms of
its parts, so this is logistic regression on differences.
"""

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from dubbing.rating.answers import Answer, Share, agreement
from dubbing.sync.closeness import LEAST, WEIGHTS

PRIOR_ANSWERS = 50  # that today's weights count as
SHARPNESS = 20.0  # logarithm of the odds for twice the closeness, as a beginning
SHARPNESS_RANGE = (0.05, 5.0)  # as a share of that
LEAST_SPREAD = 1e-4  # of a part's differences, squared: of one that never differs


def differences(answers: list[Answer]) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Logarithms (A, P) of first over second, 0 where not both have a part; answers (A,); dubs."""
    rows, first, dubs = [], [], []
    for answer in answers:
        one, other = (answer.pair[side]["parts"] for side in ("first", "second"))  # type: ignore[literal-required]
        if one and other:
            both = [(one[p], other[p]) if p in one and p in other else (1, 1) for p in WEIGHTS]
            logs = np.log2(np.maximum(both, LEAST))
            rows.append(logs[:, 0] - logs[:, 1])
            first.append(answer.first)
            dubs.append(answer.pair["dub"])
    return np.reshape(rows, (-1, len(WEIGHTS))), np.array(first), dubs


def fitted(differing: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Weights (P,) of at least 0 and the sum 1, from differences (A, P) and answers (A,).

    The prior pulls towards today's weights as strongly as `PRIOR_ANSWERS` answers of people as
    sharp as `SHARPNESS` about pairs that differ as these do.
    """
    today = np.array([*WEIGHTS.values()])
    # An answer tells most about weights where both are as likely: a quarter of its square.
    spread = np.maximum((differing**2).mean(0), LEAST_SPREAD)
    pull = PRIOR_ANSWERS * SHARPNESS**2 * spread / 4

    def loss(found: np.ndarray) -> tuple[float, np.ndarray]:
        sharp, weights = SHARPNESS * found[0], found[1:]
        logits, away = sharp * differing @ weights, weights - today
        value = (np.logaddexp(0, logits) - first * logits).sum() + pull @ away**2 / 2
        error = expit(logits) - first
        slope = sharp * error @ differing + pull * away
        return float(value), np.array([SHARPNESS * error @ (differing @ weights), *slope])

    bounds = [SHARPNESS_RANGE] + [(0, None)] * len(today)
    weights = minimize(loss, [1, *today], jac=True, method="L-BFGS-B", bounds=bounds).x[1:]
    return np.asarray(weights / max(weights.sum(), LEAST_SPREAD))


def left_out(differing: np.ndarray, first: np.ndarray, dubs: list[str]) -> Share:
    """How well weights agree with answers about a dub that they were not fitted to."""
    foretold: list[tuple[float, float]] = []
    for dub in dict.fromkeys(dubs) if len(set(dubs)) > 1 else ():
        own = np.array([name == dub for name in dubs])
        weights = fitted(differing[~own], first[~own])
        foretold += zip(first[own], differing[own] @ weights, strict=True)
    return agreement(foretold)
