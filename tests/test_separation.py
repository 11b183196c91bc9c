import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import peakflight as pf
from peakflight.separation import _nearest, closest_approach

WITHIN = 1e-6
"""How near the proven bound promises to come to the distance, m."""


def line(begin, end, duration=1.0, start_time=0.0):
    begin, end = np.array(begin, dtype=float), np.array(end, dtype=float)
    return pf.Trajectory([[begin, (end - begin) / duration]], [duration], start_time)


def wandering(seed, pieces=4, size=4.0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-size, size, (pieces + 1, 3))
    return pf.minimum_effort_spline(points, rng.uniform(0.5, 1.5, pieces))


def sampled(first, second, delays, scale, count=4001):
    """The slow twin: distances at many times, waiting at both ends."""
    flights = [flight.shift(delay) for flight, delay in zip((first, second), delays, strict=True)]
    times = np.linspace(
        min(flight.start_time for flight in flights),
        max(flight.end_time for flight in flights),
        count,
    )
    points = [flight(np.clip(times, flight.start_time, flight.end_time)) for flight in flights]
    return np.linalg.norm((points[0] - points[1]) * scale, axis=1)


@pytest.mark.kernels
def test_lines_that_cross_at_different_heights():
    first = line([-1, 0, 0], [1, 0, 0])
    second = line([0, -1, 0.3], [0, 1, 0.3])
    found = closest_approach([first, second])
    assert found.distance == pytest.approx(0.3, abs=1e-12)
    assert found.time == pytest.approx(0.5, abs=1e-3)
    assert 0.3 - WITHIN <= found.bound <= 0.3 + 1e-15
    assert found.is_kept is None
    np.testing.assert_allclose(found.positions, [[0, 0, 0], [0, 0, 0.3]], atol=1e-2)


@pytest.mark.kernels
def test_downwash_makes_heights_count_less():
    first = line([-1, 0, 0], [1, 0, 0])
    second = line([0, -1, 0.5], [0, 1, 0.5])
    found = closest_approach([first, second], separation=0.4, downwash=0.8)
    assert found.distance == pytest.approx(0.25, abs=1e-12)
    assert found.is_kept is False
    assert closest_approach([first, second], separation=0.4).is_kept is True
    assert closest_approach([first, second], separation=0.2, downwash=0.4).is_kept is True


@pytest.mark.kernels
def test_a_delay_parts_what_would_collide():
    first, second = line([-1, 0, 0], [1, 0, 0]), line([0, -1, 0], [0, 1, 0])
    together = closest_approach([first, second])
    assert together.distance == pytest.approx(0.0, abs=1e-6)
    assert together.bound >= 0.0
    # |(2t-1, -(2(t-d)-1))|^2 = (2t-1)^2 + (2t-1-2d)^2 is least where 2t-1 = d
    later = closest_approach([first, second], delays=[0.0, 0.25])
    assert later.distance == pytest.approx(0.25 * np.sqrt(2.0), abs=WITHIN)
    assert later.time == pytest.approx(0.625, abs=1e-3)


@pytest.mark.kernels
def test_drones_wait_at_their_ends():
    first = line([0, 0, 0], [1, 0, 0])
    waiting = closest_approach([first, line([5, 0, 0], [3, 0, 0])], delays=[0.0, 10.0])
    assert waiting.distance == pytest.approx(2.0, abs=1e-12)
    assert waiting.time == pytest.approx(11.0)
    before = closest_approach([line([0, 0, 0], [-9, 0, 0]), line([1, 0, 0], [9, 0, 0])])
    assert before.distance == pytest.approx(1.0, abs=1e-12)
    assert before.time == 0.0


@pytest.mark.kernels
def test_same_distance_throughout_needs_no_bisection():
    flight = wandering(1)
    found = closest_approach([flight, flight.translate([0.0, 0.7, 0.0])])
    assert found.distance == pytest.approx(0.7, abs=1e-12)
    assert found.bound == pytest.approx(0.7, abs=1e-11)


@pytest.mark.kernels
@settings(max_examples=40, deadline=None)
@given(
    seeds=st.tuples(st.integers(0, 10**6), st.integers(0, 10**6)),
    delays=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    pieces=st.tuples(st.integers(1, 5), st.integers(1, 5)),
)
def test_the_bound_is_below_every_sample_and_near_the_nearest(seeds, delays, pieces):
    first, second = (wandering(*pair) for pair in zip(seeds, pieces, strict=True))
    found = closest_approach([first, second], separation=0.4, downwash=1.0, delays=delays)
    distances = sampled(first, second, delays, [1.0, 1.0, 0.4])
    assert found.bound <= distances.min() + 1e-12
    assert 0.0 <= found.distance - found.bound <= WITHIN
    assert found.distance <= distances.min() + WITHIN


@pytest.mark.parametrize("seed", range(5))
def test_drones_that_are_off_their_trajectories_keep_the_bound(seed):
    """Off by so much in any direction, heights counted by the norm."""
    flights = [wandering(10 * seed + index, pieces=2) for index in range(3)]
    off = np.array([0.05, 0.0, 0.2])
    kept = {"separation": 0.8, "downwash": 0.4}
    plain = closest_approach(flights, **kept)
    found = closest_approach(flights, **kept, off=off)
    expected = plain.bounds - 2.0 * off[plain.pairs].sum(axis=1)
    np.testing.assert_allclose(found.bounds, np.maximum(expected, 0.0), atol=1e-12)
    assert found.bound == found.bounds.min()
    np.testing.assert_array_equal(found.distances, plain.distances)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        ways = rng.normal(size=(3, 3))
        ways *= (off / np.linalg.norm(ways, axis=1))[:, None]
        moved = [flight.translate(way) for flight, way in zip(flights, ways, strict=True)]
        assert (closest_approach(moved, **kept).distances >= found.bounds - 1e-12).all()


@pytest.mark.parametrize("off", [[0.1, -0.1], [0.1, np.nan], [np.inf, 0.0]])
def test_bad_offs_are_refused(off):
    with pytest.raises(pf.InvalidProblem, match=r"plan [01] is off by .* m; it must be from 0 to"):
        closest_approach([wandering(1), wandering(2)], off=off)


def test_many_drones_as_pair_by_pair():
    flights = [wandering(seed, pieces=3 + seed % 3) for seed in range(6)]
    delays = np.linspace(0.0, 2.0, 6)
    found = closest_approach(flights, separation=0.4, downwash=0.8, delays=delays)
    assert [tuple(pair) for pair in found.pairs] == [
        (i, j) for i in range(6) for j in range(i + 1, 6)
    ]
    for (i, j), distance in zip(found.pairs, found.distances, strict=True):
        alone = closest_approach(
            [flights[i], flights[j]], separation=0.4, downwash=0.8, delays=delays[[i, j]]
        )
        assert alone.distance == pytest.approx(distance, abs=2 * WITHIN)
    assert found.distance == found.distances.min()
    assert found.bound == found.bounds.min()
    first, second = found.pair
    between = np.subtract(*found.positions) * [1.0, 1.0, 0.5]
    assert np.linalg.norm(between) == pytest.approx(found.distance, abs=1e-9)
    assert (first, second) in {tuple(pair) for pair in found.pairs}


def test_neither_where_nor_when_matters():
    flights = [wandering(3), wandering(4)]
    here = closest_approach(flights)
    late = closest_approach([flight.shift(1.7e9) for flight in flights])
    assert late.distance == pytest.approx(here.distance, abs=WITHIN)
    assert late.time - 1.7e9 == pytest.approx(here.time, abs=1e-5)
    away = closest_approach([flight.translate([1e4, -1e4, 10.0]) for flight in flights])
    assert away.distance == pytest.approx(here.distance, abs=WITHIN)
    assert away.bound <= here.distance


def test_results_are_read_only():
    found = closest_approach([wandering(1), wandering(2)])
    for array in (found.pairs, found.times, found.distances, found.bounds, found.positions):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"separation": 0.0}, "separation is 0 m; it must be positive"),
        ({"separation": np.nan}, "separation is nan m"),
        ({"downwash": 1.0}, "without the separation"),
        ({"separation": 1.0, "downwash": -1.0}, "downwash is -1 m"),
        ({"delays": [0.0]}, "delays has shape"),
        ({"delays": [0.0, np.inf]}, "delay 1 is inf s"),
    ],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(pf.InvalidProblem, match=message):
        closest_approach([line([0, 0, 0], [1, 0, 0])] * 2, **options)


def test_one_plan_or_a_flat_one_is_refused():
    with pytest.raises(pf.InvalidProblem, match="1 plans given"):
        closest_approach([line([0, 0, 0], [1, 0, 0])])
    flat = pf.Trajectory([[[0.0, 0.0], [1.0, 1.0]]], [1.0])
    with pytest.raises(pf.InvalidProblem, match="plan 1 has 2 axes"):
        closest_approach([line([0, 0, 0], [1, 0, 0]), flat])


@settings(max_examples=20, deadline=None)
@given(
    angle=st.floats(-4.0, 4.0),
    offset=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    backwards=st.booleans(),
)
def test_turned_moved_and_backwards_together_drones_keep_their_distance(angle, offset, backwards):
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    flights = [wandering(5), wandering(6)]
    longest = max(flight.duration for flight in flights)
    changed, delays = [], []
    for flight in flights:
        other = pf.Trajectory(flight.coefficients @ turn.T, flight.segment_times).translate(offset)
        changed.append(other.reverse() if backwards else other)
        delays.append(longest - flight.duration if backwards else 0.0)
    before = closest_approach(flights, separation=0.4, downwash=0.8)
    after = closest_approach(changed, separation=0.4, downwash=0.8, delays=delays)
    assert after.distance == pytest.approx(before.distance, abs=2 * WITHIN)


def test_a_norm_that_overflows_proves_nothing():
    flights = [line([-1, 0, 0], [1, 0, 0]), line([0, -1, 0], [0, 1, 0])]
    for downwash in (1e-320, 1e-9, 1e9):
        with pytest.raises(pf.InvalidProblem, match=r"downwash is .* from 1e-06 to 1e\+06 m"):
            closest_approach(flights, separation=0.4, downwash=downwash)
    coefficients = np.zeros((2, 3, 2, 3))
    for index, flight in enumerate(flights):
        coefficients[index, 0, 0] = flight.coefficients[0, 0]
        coefficients[index, 1] = flight.coefficients[0]
        coefficients[index, 2, 0] = flight(1.0)
    breakpoints = np.array([[0.0, 0.0, 1.0, 1.0]] * 2)
    for factor in (np.inf, np.nan):
        scale = np.array([1.0, 1.0, factor])
        assert _nearest(coefficients, breakpoints, np.array([3, 3]), scale)[1][0] == 0.0


def test_flights_out_of_range_are_refused():
    near, far = line([0, 0, 0], [1, 0, 0]), line([0, 0, 0], [1e160, 0, 0])
    with pytest.raises(pf.InvalidProblem, match=r"piece 0 of plan 1 is not within 1e\+07 m"):
        closest_approach([near, far])


@pytest.mark.kernels
def test_delays_are_exact_at_unix_times():
    # two at 100 m/s that cross: a rounded delay is 1e-5 m
    start = 1.7e9
    first = line([0, 0, 0], [100, 0, 0], start_time=start)
    second = line([50, -50, 0], [50, 50, 0], start_time=start)
    delays = [0.0, 0.0123456789]
    found = closest_approach([first, second], delays=delays)
    plain = closest_approach([first.shift(-start), second.shift(-start)], delays=delays)
    assert found.distance == pytest.approx(100.0 * delays[1] / np.sqrt(2.0), abs=WITHIN)
    assert found.distance == plain.distance
    assert found.bound == plain.bound
    np.testing.assert_array_equal(found.positions, plain.positions)
