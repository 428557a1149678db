"""Scores of the embedded axis from given responses of analyses."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from embedded_tasks import OUTPUTS, ROUGH, SMOOTH, embedding_records, task_of

from granbench.benchmark.axes.embedded.analysis_errors import LARGEST_RATIO
from granbench.benchmark.axes.embedded.axis import AXIS, EMBEDDED_OBSTACLE
from granbench.benchmark.comparison import CEILING
from granbench.benchmark.predictions import assembled_predictions, evaluated
from granbench.benchmark.scorecard import Scorecard
from granbench.benchmark.scoring import score
from granbench.data.normalisation import Normalisation
from granbench.fem.statement import SOLVERS

SEEDS = (0, 1)
NAMES = (SMOOTH.name, ROUGH.name)
TRUE = {"reaction": 1e4, "volumetric_strain": 1e-3, "acceleration": 2.0, "stress": 5e4,
        "seconds": 4.0, "cell_seconds": 2.0}  # fmt: skip
"""What the ground truth has at every output step."""


@pytest.fixture(scope="module")
def task_records() -> xr.Dataset:
    return embedding_records()


@pytest.fixture
def responded(task_records: xr.Dataset) -> Callable[..., xr.Dataset]:
    """Makes predictions of the embedded axis: the truth times factors (seed, ...), by name."""
    truth = evaluated(task_records)
    sizes = {
        "seed": len(SEEDS), "solver": len(SOLVERS), "analysis": len(NAMES), "output": OUTPUTS + 1,
        "gauss_point": SMOOTH.points, "component": truth.sizes["component"],
    }  # fmt: skip

    def make(**factors: np.ndarray | float) -> xr.Dataset:
        variables = {}
        for name, stored in AXIS.layout.items():
            quantity = name.removeprefix("embedded_").removeprefix("truth_")
            shape = tuple(sizes[dim] for dim in stored.dims)
            factor = 1.0 if "truth" in name else factors.get(quantity, 1.0)
            variables[name] = (stored.dims, np.broadcast_to(TRUE[quantity] * factor, shape).copy())
        coordinates = {
            "solver": list(SOLVERS), "analysis": list(NAMES), "output": range(OUTPUTS + 1),
            "gauss_point": range(SMOOTH.points), "component": truth["component"].values,
        }  # fmt: skip
        part = xr.Dataset(variables, coordinates, {EMBEDDED_OBSTACLE: ""})
        return assembled_predictions([part], dataset=truth, seeds=SEEDS, attrs={"model": "by-hand"})

    return make


@pytest.fixture
def card(task_records: xr.Dataset) -> Callable[[xr.Dataset], Scorecard]:
    normalisation = Normalisation.from_training(task_records)
    return lambda predictions: score(
        predictions, evaluated(task_records), normalisation, task_of(task_records)
    )


def value(found: Scorecard, metric: str, group: str = "all", solver: str = "explicit") -> float:
    scored = found.find(f"embedded-{solver}", "all", metric, group)
    assert scored.value is not None, scored.reason
    return scored.value


def lost_from(output: int, places: tuple[int, ...]) -> np.ndarray:
    """Factors of the reaction: 1, and NaN from an output step on in some analyses."""
    factor = np.ones((len(SEEDS), len(SOLVERS), len(NAMES), OUTPUTS + 1))
    for place in places:
        factor[:, :, place, output:] = np.nan
    return factor


def test_the_truth_has_the_scores_that_the_metrics_state(responded, card) -> None:
    found = card(responded())
    for part in AXIS.parts:
        for metric in AXIS.metrics():
            if metric.applies_to(part):
                assert found.find(part.name, "all", metric.name).value == metric.of_truth
    assert all(not any(curve.value) for curve in found.curves)


def test_a_curve_that_is_off_by_a_tenth_has_an_error_of_a_tenth(responded, card) -> None:
    found = card(responded(reaction=1.1))
    assert value(found, "reaction_error") == pytest.approx(0.1, rel=1e-3)  # kept with 15 bits
    assert value(found, "volumetric_strain_error") == 0.0


def test_the_mean_over_seeds_is_that_of_their_errors(responded, card) -> None:
    off = np.array([1.1, 1.3])[:, None, None, None]
    found = card(responded(reaction=off)).find("embedded-implicit", "all", "reaction_error")
    assert found.by_seed == pytest.approx((0.1, 0.3), rel=1e-3)
    assert found.value == pytest.approx(0.2, rel=1e-3)
    assert found.low is None and found.n == len(NAMES)


def test_a_run_that_fails_counts_ten_in_what_it_did_not_reach(responded, card) -> None:
    found = card(responded(reaction=lost_from(OUTPUTS // 2 + 1, (0,))))
    assert value(found, "reached_share", "smooth") == 0.5
    assert value(found, "reached_share", "rough") == 1.0
    assert value(found, "reached_share") == 0.75
    expected = np.sqrt(0.5 * CEILING**2)
    assert value(found, "reaction_error", "smooth") == pytest.approx(expected, rel=1e-6)
    assert value(found, "acceleration_ratio", "smooth") == LARGEST_RATIO
    assert value(found, "acceleration_ratio") == pytest.approx(np.sqrt(LARGEST_RATIO), rel=1e-6)
    timed = found.find("embedded-explicit", "all", "analysis_speed_ratio", "smooth")
    assert timed.status == "not_applicable" and "early" in (timed.reason or "")


def test_error_points_are_beyond_half_of_the_true_stress(responded, card) -> None:
    points = np.ones((1, 1, 1, 1, SMOOTH.points, 1))
    points[..., : SMOOTH.points // 4, :] = 1.6
    found = card(responded(stress=points))
    assert value(found, "error_point_share") == 0.25
    assert value(found, "error_point_growth") == pytest.approx(0.0, abs=1e-12)
    growing = np.ones((1, 1, 1, OUTPUTS + 1, 1, 1))
    growing[:, :, :, OUTPUTS // 2 + 1 :] = 1.6
    assert value(card(responded(stress=growing)), "error_point_growth") > 0.0


def test_speed_up_is_the_time_of_the_truth_over_that_of_the_model(responded, card) -> None:
    factor = np.array([0.5, 2.0])[None, None, :]
    found = card(responded(seconds=factor))
    assert value(found, "analysis_speed_ratio", "smooth") == pytest.approx(2.0, rel=1e-3)
    assert value(found, "analysis_speed_ratio") == pytest.approx(1.0, rel=1e-3)  # geometric


def test_an_analysis_is_lost_where_a_fifth_of_the_reaction_is_missing(responded, card) -> None:
    factor = np.ones((1, 1, len(NAMES), 1))
    factor[:, :, 1] = 0.7
    lost = AXIS.lost_results(card(responded(reaction=factor)).scores)
    assert lost == {(part.name, group) for part in AXIS.parts for group in ("rough", "all")}
