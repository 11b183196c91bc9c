"""CMA-ES: minimise a function of many numbers by its values alone (Hansen 2016)."""

from collections.abc import Callable

import numpy as np


def minimise(
    value_of: Callable[[np.ndarray], float],
    start: np.ndarray,
    *,
    spread: float,
    evaluations: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, float]:
    """The best point seen in about `evaluations`, and its value.

    start: (n,) mean of the first generation; spread: its standard deviation.
    """
    n = len(start)
    size = 4 + int(3.0 * np.log(n))
    weights = np.log(0.5 * (size + 1)) - np.log(np.arange(1, size // 2 + 1))
    weights /= weights.sum()
    mass = 1.0 / (weights**2).sum()
    path_rate = (4.0 + mass / n) / (n + 4.0 + 2.0 * mass / n)
    spread_rate = (mass + 2.0) / (n + mass + 5.0)
    one_rate = 2.0 / ((n + 1.3) ** 2 + mass)
    many_rate = min(1.0 - one_rate, 2.0 * (mass - 2.0 + 1.0 / mass) / ((n + 2.0) ** 2 + mass))
    damping = 1.0 + spread_rate + 2.0 * max(0.0, np.sqrt((mass - 1.0) / (n + 1.0)) - 1.0)
    usual = np.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n**2))
    mean, path, spread_path = start.copy(), np.zeros(n), np.zeros(n)
    covariance = np.eye(n)
    best, lowest = mean, value_of(mean)
    for generation in range(1, evaluations // size + 1):
        roots, axes = np.linalg.eigh(covariance)
        roots = np.sqrt(np.maximum(roots, 1e-20))
        normal = rng.standard_normal((size, n))
        steps = (normal * roots) @ axes.T
        values = np.array([value_of(mean + spread * step) for step in steps])
        order = np.argsort(values)[: len(weights)]
        if values[order[0]] < lowest:
            best, lowest = mean + spread * steps[order[0]], float(values[order[0]])
        step = weights @ steps[order]
        mean = mean + spread * step
        spread_path *= 1.0 - spread_rate
        white = axes @ (weights @ normal[order])
        spread_path += np.sqrt(spread_rate * (2.0 - spread_rate) * mass) * white
        length = np.linalg.norm(spread_path)
        early = np.sqrt(1.0 - (1.0 - spread_rate) ** (2 * generation))
        steady = bool(length / early < (1.4 + 2.0 / (n + 1.0)) * usual)
        path *= 1.0 - path_rate
        if steady:
            path += np.sqrt(path_rate * (2.0 - path_rate) * mass) * step
        covariance *= 1.0 - one_rate - many_rate
        covariance += one_rate * np.outer(path, path)
        covariance += many_rate * (steps[order].T * weights) @ steps[order]
        spread *= float(np.exp((spread_rate / damping) * (length / usual - 1.0)))
    return best, lowest
