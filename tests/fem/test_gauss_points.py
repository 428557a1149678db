"""The material at the Gauss points: what goes in, what comes out, and what is refused."""

import numpy as np
import pytest
import torch
from plane_bodies import STIFFNESS, Body, bounded_by, elastic_cell
from torch import Tensor

from granbench.cell import ModuleCell
from granbench.errors import ConfigurationError
from granbench.fem import ExplicitSettings, ImplicitSettings, rectangle, run
from granbench.fem.cell_failure import CellFailure
from granbench.fem.gauss_points import GaussPoints, MaterialFailure
from granbench.models import MODELS

POSITIONS = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
DSTRAIN = np.array([1e-3, 2e-3, 3e-3, -1e-3, 0.0, 1e-3, 5e-4, 0.0, 0.0])


class Breaks(torch.nn.Module):
    """Elastic up to a strain xx or yy at which the stress is lost."""

    def __init__(self, limit: float, lost: float = torch.nan) -> None:
        super().__init__()
        self.limit, self.lost = limit, lost

    def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        strain = state[:, 3:] + dstrain
        stress = state[:, :3] + dstrain @ torch.from_numpy(STIFFNESS)
        broken = (strain.abs() > self.limit).any(dim=1, keepdim=True)
        stress = torch.where(broken, self.lost, stress)
        return stress, torch.cat([stress, strain], dim=1)


def breaking_cell(limit: float, lost: float = torch.nan) -> ModuleCell:
    from granbench.cell import StateLayout

    layout = StateLayout.of(stress=3, total_strain=3)
    return ModuleCell(
        Breaks(limit, lost), name="brittle", order="plane", layout=layout, dtype=torch.float64
    )


def test_vectors_are_component_major() -> None:
    points = GaussPoints(elastic_cell(), np.zeros((3, 3)), POSITIONS)
    stress = points.step(DSTRAIN, 1)
    np.testing.assert_allclose(stress.reshape(3, 3), STIFFNESS @ DSTRAIN.reshape(3, 3), rtol=1e-14)


def test_a_trial_leaves_the_state_until_it_is_accepted() -> None:
    points = GaussPoints(elastic_cell(), np.zeros((3, 3)), POSITIONS)
    first = points.step(DSTRAIN, 1).copy()
    np.testing.assert_array_equal(points.step(DSTRAIN, 1), first)
    assert not points.strain.any()
    points.accept()
    np.testing.assert_array_equal(points.stress, first)
    np.testing.assert_array_equal(points.strain, DSTRAIN)
    np.testing.assert_allclose(points.step(DSTRAIN, 2), 2.0 * first, rtol=1e-14)


def test_single_precision_cell_answers_in_double() -> None:
    exact = GaussPoints(elastic_cell(), np.zeros((3, 3)), POSITIONS).step(DSTRAIN, 1)
    single = GaussPoints(elastic_cell(torch.float32), np.zeros((3, 3)), POSITIONS)
    stress, tangent = single.tangent(DSTRAIN, 1)
    assert stress.dtype == tangent.dtype == np.float64
    np.testing.assert_allclose(stress, exact, rtol=1e-5, atol=1e-3)  # single precision
    np.testing.assert_allclose(tangent, np.tile(STIFFNESS, (3, 1, 1)), rtol=1e-6)


def test_start_is_known_to_the_cell() -> None:
    pressure = np.outer((1.0, 1.0, 0.0), np.full(3, 1e5))
    cell = MODELS["csuh"]()
    points = GaussPoints(cell, pressure, POSITIONS, {"initial_void_ratio": 0.7})
    np.testing.assert_allclose(points.internals()["void_ratio"], 0.7)
    np.testing.assert_array_equal(points.stress, pressure.ravel())


def test_cell_in_other_components_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="3 principal components .* plane strain needs xx"):
        GaussPoints(MODELS["ime"](order="principal"), np.zeros((3, 3)), POSITIONS)


def test_stress_of_another_shape_is_refused() -> None:
    class Wide(torch.nn.Module):
        def forward(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
            return torch.cat([dstrain, dstrain], dim=1), state

    cell = ModuleCell(Wide(), name="wide", order="plane", dtype=torch.float64)
    points = GaussPoints(cell, np.zeros((3, 3)), POSITIONS)
    with pytest.raises(CellFailure, match=r"stress of shape \(3, 6\); it must be \(3, 3\)"):
        points.step(DSTRAIN, 1)


@pytest.mark.parametrize("lost", [np.nan, np.inf])
def test_lost_stress_names_point_position_step_and_strain(lost: float) -> None:
    points = GaussPoints(breaking_cell(2.5e-3, lost), np.zeros((3, 3)), POSITIONS)
    with pytest.raises(MaterialFailure) as caught:
        points.step(DSTRAIN, 7)
    failure = caught.value
    assert (failure.point, failure.step, failure.count) == (2, 7, 1)
    assert failure.position == (0.5, 0.6)
    assert failure.strain == (3e-3, 1e-3, 0.0)
    for part in ("brittle", "point 2", "(0.5, 0.6)", "step 7", "0.003, 0.001, 0"):
        assert part in str(failure)


def test_cell_that_raises_at_one_point_fails_there_alone() -> None:
    class Raises(torch.nn.Module):
        def forward(self, dstrain: Tensor, stress: Tensor) -> Tensor:
            if (dstrain[:, 0] > 2.5e-3).any():
                raise FloatingPointError
            return stress + dstrain

    cell = ModuleCell(Raises(), name="raises", order="plane", dtype=torch.float64)
    points = GaussPoints(cell, np.zeros((3, 3)), POSITIONS)
    with pytest.raises(MaterialFailure, match="Gauss point 2"):
        points.step(DSTRAIN, 1)


@pytest.mark.parametrize("settings", [ExplicitSettings(outputs=50), ImplicitSettings(steps=50)])
def test_failed_run_keeps_what_was_computed(
    settings: ExplicitSettings | ImplicitSettings,
) -> None:
    loading = bounded_by(lambda x: 0.0 * x[:, 0], lambda x: -0.1 * x[:, 1])
    mesh = rectangle(1.0, 1.0, 2, 2)
    found = run(Body(loading), breaking_cell(0.05), solver=settings, mesh=mesh)
    assert isinstance(found.failure, MaterialFailure)
    assert found.failure.strain[1] > 0.05
    kept = found.dataset
    assert kept.attrs["completed"] == 0
    assert "gives no finite stress" in kept.attrs["failure"]
    assert kept.attrs["failed_step"] == found.failure.step
    assert kept["strain"].values[-1, :, 1].max() == pytest.approx(0.05, abs=0.002)
    assert np.isfinite(kept["reaction"].values).all()
    with pytest.raises(MaterialFailure):
        found.check()
