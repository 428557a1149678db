"""What is done to a body: histories, prescribed motion, pressures."""

import numpy as np
import pytest

from granbench.errors import ConfigurationError
from granbench.fem import rectangle
from granbench.fem.assembled_loading import assemble_loading
from granbench.fem.implicit import load_times
from granbench.fem.loading import Loading, LoadingHistory, Prescribed, Pressure, Traction
from granbench.fem.operators import build_operators
from granbench.fem.problems.biaxial import Biaxial
from granbench.paths.confining_pressure import RandomConfinement

PUSH = LoadingHistory((0.0, 1.0), (0.0, 1.0))


def test_path_that_is_not_monotone_in_time_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="entry 2.*0.5 s"):
        LoadingHistory((0.0, 1.0, 0.5), (0.0, 1.0, 2.0))


@pytest.mark.parametrize(
    ("times", "values", "sentence"),
    [
        ((0.0, 1.0), (0.0,), "2 times and 1 values"),
        ((0.0,), (0.0,), "1 times"),
        ((0.1, 1.0), (0.0, 1.0), "0.1 s"),
        ((0.0, 1.0), (0.0, np.nan), "not finite"),
    ],
)
def test_damaged_path_is_refused(times: tuple, values: tuple, sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        LoadingHistory(times, values)


def test_history_through_turning_points_keeps_its_speed() -> None:
    there_and_back = LoadingHistory.through([0.05, 0.03], 0.1)
    assert there_and_back.times == pytest.approx((0.0, 0.5, 0.7))
    assert there_and_back.values == pytest.approx((0.0, 0.05, 0.03))
    assert there_and_back.at(0.6) == pytest.approx(0.04)
    with pytest.raises(ConfigurationError, match="speed"):
        LoadingHistory.through([0.1], 0.0)


def test_every_turning_point_is_a_load_step() -> None:
    drive = Biaxial(cycles="cyclic").drive_history()
    times = load_times(drive, 50)
    assert set(drive.times) <= set(times)
    assert (np.diff(times) > 0.0).all()
    assert len(load_times(PUSH, 100)) == 101


@pytest.mark.parametrize("ends", ["rough", "smooth"])
@pytest.mark.parametrize("element", ["quad8", "quad4", "tri3", "tri6"])
def test_platens_spread_their_motion_linearly_over_the_specimen(ends: str, element: str) -> None:
    mesh = rectangle(0.5, 1.0, 4, 4, element)
    operators = build_operators(mesh)
    spread = assemble_loading(Biaxial(ends=ends).loading(mesh), operators, 2650.0).spread
    x, y = spread.reshape(2, -1)
    np.testing.assert_allclose(x, 0.0, atol=1e-13)
    np.testing.assert_allclose(y, -mesh.nodes[:, 1], atol=1e-13)


def test_motion_that_is_not_affine_is_interpolated_smoothly() -> None:
    """A strip of the top is pressed in: zero where held, and never beyond what is prescribed."""
    mesh = rectangle(1.0, 1.0, 8, 8)
    operators = build_operators(mesh)

    def strip(x: np.ndarray) -> np.ndarray:
        return np.where(np.abs(x[:, 0] - 0.5) < 0.26, -1.0, 0.0)

    held = tuple(Prescribed(side, x=0.0, y=0.0) for side in ("left", "right", "bottom"))
    top = Prescribed("top", y=strip)
    assembled = assemble_loading(Loading((*held, top), PUSH), operators, 1.0)
    y = assembled.spread.reshape(2, -1)[1]
    np.testing.assert_array_equal(y[mesh.nodes_on("top")], strip(mesh.nodes[mesh.nodes_on("top")]))
    below = y[mesh.node_at(0.5, 0.5)]
    assert -1.0 < below < -0.1
    stress = operators.strain @ assembled.spread
    assert np.abs((operators.force @ stress)[assembled.free_places]).max() < 1e-12


def test_body_that_can_move_as_a_whole_is_refused() -> None:
    operators = build_operators(rectangle(0.5, 1.0, 2, 4))
    loading = Loading((Prescribed("bottom", y=0.0), Prescribed("top", y=-1.0)), PUSH)
    with pytest.raises(ConfigurationError, match="move as a whole"):
        assemble_loading(loading, operators, 1.0)


def test_contradicting_motions_are_refused_where_they_meet() -> None:
    operators = build_operators(rectangle(0.5, 1.0, 2, 4))
    loading = Loading((Prescribed("bottom", x=0.0, y=0.0), Prescribed("left", x=1.0)), PUSH)
    with pytest.raises(ConfigurationError, match=r"node at \(0, 0\) in direction x"):
        assemble_loading(loading, operators, 1.0)


def test_forces_follow_their_histories() -> None:
    operators = build_operators(rectangle(0.5, 1.0, 2, 4))
    held = (Prescribed("bottom", x=0.0, y=0.0),)
    rising = LoadingHistory((0.0, 2.0), (0.0, 4.0))
    forces = (Pressure("right", rising), Traction("top", (1.0, 0.0), LoadingHistory.constant(3.0)))
    assembled = assemble_loading(Loading(held, PUSH, forces, (0.0, -10.0)), operators, 2.0)
    force = assembled.external_force(assembled.force_values(1.0)).reshape(2, -1).sum(axis=1)
    # The pressure pushes to the left over 1 m, the traction to the right over 0.5 m, weight down.
    np.testing.assert_allclose(force, [-2.0 * 1.0 + 3.0 * 0.5, -10.0 * 2.0 * 0.5], atol=1e-12)


@pytest.mark.parametrize("curvature", [1.0, 2.0, 3.0, 4.0, 5.0])
def test_random_confinement_starts_at_its_mean_and_turns_more_with_v_c(curvature: float) -> None:
    paths = [RandomConfinement(curvature, seed).pressures()[1] for seed in range(200)]
    assert all(path[0] == 1e5 for path in paths)
    spread = np.std(paths, axis=0)
    # 200 paths give a standard deviation to 5 %; three of those.
    np.testing.assert_allclose(spread[25:], 2e4, rtol=0.15)
    slope = np.diff(np.array(paths)[:, 25:], axis=1) * 100.0
    # The slope of exp(-v_c d^2) has the standard deviation s sqrt(2 v_c).
    assert np.std(slope) == pytest.approx(2e4 * np.sqrt(2.0 * curvature), rel=0.15)


def test_random_confinement_is_the_same_for_the_same_seed() -> None:
    first, again, other = (RandomConfinement(3.0, seed).pressures()[1] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e3


def test_confinement_that_turns_into_tension_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="seed"):
        RandomConfinement(1.0, 2, deviation=1e6).pressures()
    with pytest.raises(ConfigurationError, match="v_c"):
        RandomConfinement(-1.0)
