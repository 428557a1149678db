"""IME against closed forms, and in plane strain against three dimensions."""

import math

import pytest
import torch
from plastic_paths import (
    compressed,
    isotropic,
    plastic_rows,
    random_increments,
    run,
    stress_of,
)

from granbench.cells.contract import Conditions
from granbench.models.ime import IME
from granbench.models.j2 import J2

YOUNG, POISSON = 20e6, 0.2


@pytest.mark.parametrize(
    ("parameter_set", "constant"), [("guan2023-sec5.2.1", 1e3), ("guan2023-tab7.1", 0.1e6)]
)
def test_triaxial_compression_follows_the_hardening_law(parameter_set, constant):
    # sigma_v = sigma_0 + A (eps_0 + sqrt(3/2) eps^p_11)^n, eps_11 = sigma_v/E + eps^p_11, as the
    # plastic strain keeps its volume: (1, -1/2, -1/2) eps^p_11.
    cell = IME(parameter_set=parameter_set, order="principal")
    states = compressed(cell, isotropic(cell, 1), (1e-3, 0.0, 0.0), (1, 2), 80)
    for step in (20, 50, 79):
        axial = (step + 1) * 1e-3
        deviator = float(states[step, 0, 0]) - 1e5
        plastic = axial - deviator / YOUNG
        expected = constant + 0.3e6 * (0.02 + math.sqrt(1.5) * plastic) ** 0.2
        assert deviator == pytest.approx(expected, rel=1e-10)


def test_the_sets_differ_in_the_constant_part_only():
    one, other = (IME(parameter_set=name).values() for name in IME.parameter_sets)
    assert one.pop("yield_stress") == 1e3
    assert other.pop("yield_stress") == 1e5
    assert one == other
    assert IME().values()["yield_stress"] == 1e3


@pytest.mark.parametrize("order", ["plane", "full"])
def test_without_hardening_plane_strain_strength_is_two_over_root_three(order):
    """A -> 0 leaves J2 in plane strain: s1 - s3 = 1.1547 sigma_0 at full flow."""
    values = {"hardening_modulus": 1e-6, "yield_stress": 1e5, "poisson_ratio": 0.25}
    cell = IME(values, order=order)
    driven = (2e-4, 0.0, 0.0) if order == "plane" else (2e-4, 0.0, 0.0, 0.0, 0.0, 0.0)
    states = compressed(cell, isotropic(cell, 1), driven, (1,), 600)
    difference = states[-1, 0, 0] - states[-1, 0, 1]
    # At its maximum there: off by the square of what the middle stress has left to go.
    assert float(difference) == pytest.approx(2.0 / math.sqrt(3.0) * 1e5, rel=1e-6)
    middle = float(states[-1, 0, 3 if order == "plane" else 2])
    assert middle == pytest.approx(1e5 + float(difference) / 2.0, rel=1e-3)


def test_without_hardening_it_is_three_dimensional_j2():
    ime = IME({"hardening_modulus": 1e-6, "yield_stress": 1e5}, order="full")
    j2 = J2(
        {
            "bulk_modulus": YOUNG / (3.0 * (1.0 - 2.0 * POISSON)),
            "shear_modulus": YOUNG / (2.0 * (1.0 + POISSON)),
            "yield_stress": 1e5,
        },
        order="full",
    )
    increments = random_increments(ime, 20, 40, 2e-3)
    stress, expected = (
        stress_of(cell, run(cell, increments, isotropic(cell, 20))) for cell in (ime, j2)
    )
    # What is left of the hardening, 1e-6 Pa, and rounding.
    torch.testing.assert_close(stress, expected, rtol=1e-9, atol=1e-4)


def test_plane_strain_is_three_dimensions_without_the_third():
    plane, full = IME(order="plane"), IME(order="full")
    increments = random_increments(plane, 20, 40, 2e-3)
    wide = torch.zeros(40, 20, 6, dtype=torch.float64)
    wide[..., [0, 1, 5]] = increments
    in_plane = run(plane, increments, isotropic(plane, 20))
    in_space = run(full, wide, isotropic(full, 20))
    names = ("plastic_strain_xx", "plastic_strain_yy", "plastic_strain_xy", "plastic_strain_zz")
    torch.testing.assert_close(
        stress_of(plane, in_plane), stress_of(full, in_space)[..., [0, 1, 5]], rtol=1e-10, atol=1e-5
    )
    zz = in_plane[..., plane.layout["out_of_plane_stress"]]
    torch.testing.assert_close(zz.squeeze(-1), in_space[..., 2], rtol=1e-10, atol=1e-5)
    for name in names:
        of_plane = in_plane[..., plane.layout[name]]
        torch.testing.assert_close(
            of_plane, in_space[..., full.layout[name]], rtol=1e-9, atol=1e-13
        )


def test_the_out_of_plane_stress_may_be_given():
    cell = IME()
    stress = torch.tensor([[1e5, 2e5, 0.0]], dtype=torch.float64)
    known = {"out_of_plane_stress": torch.tensor([4e4])}
    assert float(cell.initial_state(Conditions(stress, known))[0, 3]) == 4e4
    assert float(cell.initial_state(Conditions(stress))[0, 3]) == 1.5e5


def test_plastic_strain_may_be_given():
    """A start that was strained before yields at the strength that it was hardened to."""
    cell = IME(order="principal")
    stress = torch.zeros(1, 3, dtype=torch.float64)
    known = {f"plastic_strain_{k}{k}": torch.tensor([v]) for k, v in ((1, 0.1), (2, -0.1))}
    state = cell.initial_state(Conditions(stress, known))
    expected = torch.tensor([[0.1], [-0.1], [0.0]], dtype=torch.float32).double()
    torch.testing.assert_close(plastic_rows(cell, state), expected)
