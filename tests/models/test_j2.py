"""J2 against its closed forms, in the plane and in three dimensions."""

import math

import numpy as np
import pytest
import torch
from plastic_paths import compressed, isotropic, random_increments, run, stress_of

from granbench.cells.contract import Conditions
from granbench.models.j2 import J2


def point_by_point(cell: J2, increments: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Eq 7.37 as a textbook has it: one point, tensors as matrices."""
    values = cell.values()
    bulk, shear = values["bulk_modulus"], values["shear_modulus"]
    sigma = np.array([[stress[0], stress[2]], [stress[2], stress[1]]])
    ends = []
    for xx, yy, xy in increments:
        strain = np.array([[xx, xy], [xy, yy]])
        unit = np.eye(2)
        volumetric = np.trace(strain)
        trial = sigma + bulk * volumetric * unit + 2.0 * shear * (strain - volumetric / 2.0 * unit)
        p = np.trace(trial) / 2.0
        s = trial - p * unit
        q = math.sqrt(2.0 * (s * s).sum())
        sigma = p * unit + s * min(1.0, values["yield_stress"] / q)
        ends.append([sigma[0, 0], sigma[1, 1], sigma[0, 1]])
    return np.array(ends)


def test_the_batch_is_the_textbook_point_by_point():
    cell = J2()
    increments = random_increments(cell, 7, 30, 2e-2)
    stress = stress_of(cell, run(cell, increments, isotropic(cell, 7)))
    for point in range(7):
        expected = point_by_point(cell, increments[:, point].numpy(), np.array([1e5, 1e5, 0.0]))
        # Rounding of thirty additions.
        np.testing.assert_allclose(stress[:, point].numpy(), expected, rtol=1e-10, atol=1e-6)


def test_elastic_moduli_are_those_of_the_thesis():
    # sigma = K eps_v I + 2 G e with E = 2 MPa and nu = 0.2 of plane stress.
    cell = J2()
    state = cell.initial_state(Conditions(torch.zeros(1, 3)))
    stress, _ = cell.step(torch.tensor([[-0.2e-3, 1e-3, 0.0]]), state)
    torch.testing.assert_close(stress.double(), torch.tensor([[0.0, 2e3, 0.0]]).double(),
                               rtol=1e-6, atol=1e-3)  # fmt: skip


def test_biaxial_strength_in_the_plane_is_the_yield_stress():
    # Without lateral stress s = (Q/2, -Q/2), so that q = sqrt(2 s:s) = Q: strength sigma_Y.
    cell = J2()
    start = cell.initial_state(Conditions(torch.zeros(1, 3, dtype=torch.float64)))
    states = compressed(cell, start, (0.0, 5e-3, 0.0), (0,), 40)
    axial = stress_of(cell, states)[:, 0, 1]
    # Newton's tolerance on the lateral stress is 1e-6 Pa.
    assert float(axial[-1]) == pytest.approx(1e5, rel=1e-10)
    # Until then the modulus is E = 2 MPa of uniaxial stress.
    torch.testing.assert_close(axial[:9], 2e6 * 5e-3 * torch.arange(1, 10).double())


BULK, SHEAR, YIELD = 2e7, 1.2e7, 1e5
"""In three dimensions: nu = (3 K - 2 G)/(6 K + 2 G) = 0.25."""


def smooth_biaxial(steps: int) -> tuple[J2, torch.Tensor]:
    """Plane strain, 11 compressed, 22 free of stress, 33 kept from straining."""
    values = {"bulk_modulus": BULK, "shear_modulus": SHEAR, "yield_stress": YIELD}
    cell = J2(values, order="principal")
    start = cell.initial_state(Conditions(torch.zeros(1, 3, dtype=torch.float64)))
    return cell, compressed(cell, start, (2e-4, 0.0, 0.0), (1,), steps)


def test_smooth_biaxial_strength_in_plane_strain_is_two_over_root_three():
    _, states = smooth_biaxial(400)
    # The out-of-plane stress tends to half the axial one; the strength, at its maximum there, is
    # off by the square of what is missing.
    assert float(states[-1, 0, 0]) == pytest.approx(2.0 / math.sqrt(3.0) * YIELD, rel=1e-6)
    assert float(states[-1, 0, 2]) == pytest.approx(YIELD / math.sqrt(3.0), rel=1e-2)


def test_smooth_biaxial_yields_first_at_the_elastic_limit():
    poisson = (3.0 * BULK - 2.0 * SHEAR) / (6.0 * BULK + 2.0 * SHEAR)
    limit = YIELD / math.sqrt(1.0 - poisson + poisson**2)
    cell, states = smooth_biaxial(60)
    axial = states[:, 0, 0]
    # Uniaxial stiffness of plane strain until then, less beyond.
    young = 9.0 * BULK * SHEAR / (3.0 * BULK + SHEAR)
    line = young / (1.0 - poisson**2) * 2e-4 * torch.arange(1, 61).double()
    on_line = (axial - line).abs() < 1e-6 * line
    assert torch.equal(on_line, line <= limit)
    assert on_line.any()
    assert not on_line.all()
    stress = torch.tensor([[limit], [0.0], [poisson * limit]], dtype=torch.float64)
    s = cell.rows.deviator(stress)
    assert float(cell.rows.deviatoric_stress(s)) == pytest.approx(YIELD, rel=1e-12)


def test_the_mean_stress_is_elastic():
    cell = J2()
    increments = random_increments(cell, 5, 40, 2e-2)
    states = run(cell, increments, isotropic(cell, 5))
    p = cell.rows.mean(states[-1].T)
    expected = 1e5 + 1.25e6 * increments.sum(dim=0)[:, :2].sum(dim=-1)
    torch.testing.assert_close(p, expected, rtol=1e-10, atol=1e-6)
