"""The slope of a mean with jumps: what gradients miss, fitted; and what the fit is worth in noise."""

import numpy as np

from tuning.core.slope import offsets, pairs_within, pooled_slope

SIZE = 6


def staircase(points, thresholds, height=0.1):
    """Stairs along a direction, and a smooth part; with its gradient, which knows nothing of the stairs."""
    along = np.arange(1, SIZE + 1) / SIZE
    smooth = 0.5 * np.ones(SIZE)
    losses = height * np.floor(points @ along / height + thresholds) + points @ smooth
    return losses, np.broadcast_to(smooth, points.shape), along + smooth


def pairs_of(pairs, seed=0):
    apart = offsets((seed, pairs), pairs, SIZE, 0.05)
    return apart, np.random.default_rng(seed).uniform(size=pairs)


def test_fit_finds_what_gradients_miss():
    apart, thresholds = pairs_of(4000)
    (up, g, wanted), (down, _, _) = (staircase(x, thresholds) for x in (apart, -apart))
    found = pooled_slope(np.stack([up, down]), np.stack([g, g]), apart)
    assert np.linalg.norm(g.mean(axis=0) - wanted) > 1
    np.testing.assert_allclose(found.slope, wanted, atol=0.06)
    assert found.share > 0.95


def test_right_gradients_stay_in_noise():
    rng = np.random.default_rng(1)
    apart, _ = pairs_of(40)
    gradient = np.arange(SIZE) * 1.0
    losses = np.stack([apart @ gradient, -apart @ gradient]) + rng.normal(size=(2, 40))
    found = pooled_slope(losses, np.broadcast_to(gradient, (2, 40, SIZE)), apart)
    alone = np.linalg.lstsq(apart, (losses[0] - losses[1]) / 2, rcond=None)[0]
    assert np.linalg.norm(found.slope - gradient) < 0.7 * np.linalg.norm(alone - gradient)


def test_too_few_pairs_leave_the_gradient():
    apart, thresholds = pairs_of(SIZE)
    up, g, _ = staircase(apart, thresholds)
    found = pooled_slope(np.stack([up, -up]), np.stack([g, g]), apart)
    np.testing.assert_allclose(found.slope, g[0])
    assert found.share == 0


def test_pairs_keep_within_limits():
    low, high = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.01])
    points = np.array([[0.0, 2.0, 0.005], [-1.0, 1.99, 0.0]])
    apart = np.array([[0.2, -0.1, 0.05], [-0.3, 0.0, 1e-3]])
    centre, kept = map(np.asarray, pairs_within(points[None], apart, low, high))
    both = np.stack([centre + kept[:, None], centre - kept[:, None]])
    assert np.all(both >= low - 1e-15) and np.all(both <= high + 1e-15)
    np.testing.assert_array_equal(kept, [[0.2, -0.1, 0.005], [-0.3, 0.0, 1e-3]])
    wanted = [[[0.0, 1.9, 0.005], [-0.8, 1.9, 0.005]], [[0.0, 2.0, 0.005], [-0.7, 1.99, 1e-3]]]
    np.testing.assert_allclose(centre, wanted, rtol=1e-14)
