"""Laws of the loading programmes: lengths, corners, controlled stresses, refused fields."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granbench.errors import ConfigurationError
from granbench.paths import (
    ConstantMeanStress,
    ConstantMinorStress,
    CyclicTriaxial,
    RandomStrain,
)
from granbench.paths.cyclic import DRAWN_AMPLITUDES, DRAWN_LOOPS, DRAWN_PATH_LENGTH
from granbench.paths.random_strain import HIGHEST_DRAWN_PRESSURE, TABLE_POINTS

pressures = st.floats(1e4, 1e7)
ratios = st.floats(0.0, 1.0)
seeds = st.integers(0, 2**31 - 1)
monotonic = st.builds(
    lambda family, p, b: family(pressure=p, b=b),
    st.sampled_from([ConstantMeanStress, ConstantMinorStress]), pressures, ratios,
)  # fmt: skip
cyclic = st.builds(lambda s, p: CyclicTriaxial.draw(np.random.default_rng(s), p), seeds, pressures)
random_strain = st.builds(
    lambda s, p: RandomStrain.draw(np.random.default_rng(s), p), seeds, st.floats(1e4, 4e6)
)
programmes = st.one_of(monotonic, cyclic, random_strain)


@given(programme=programmes)
@settings(deadline=None)
def test_every_programme_starts_from_the_isotropic_state_without_strain(programme):
    isotropic = np.full(3, programme.pressure)
    np.testing.assert_array_equal(programme.driven_strain(0.0), 0.0)
    np.testing.assert_allclose(
        programme.controlled_stresses @ isotropic, programme.targets(0.0),
        atol=1e-9 * programme.pressure,
    )  # fmt: skip
    assert programme.stress_error(isotropic, 0.0) == pytest.approx(0.0, abs=1e-9)


@given(programme=programmes)
@settings(deadline=None)
def test_free_strains_and_controlled_stresses_match_and_determine_each_other(programme):
    free, controlled = programme.free_directions, programme.controlled_stresses
    assert free.shape == controlled.T.shape
    assert np.isfinite(np.linalg.cond(controlled @ (np.eye(3) + 1.0) @ free))


@given(programme=programmes)
@settings(deadline=None)
def test_a_programme_is_its_own_plain_configuration(programme):
    assert type(programme).model_validate(programme.model_dump(mode="json")) == programme


@given(
    programme=monotonic.filter(lambda p: 0 <= p.b <= 1),
    minor=st.floats(1e3, 1e7),
    deviator=st.floats(1e3, 1e7),
)
def test_the_ratio_row_vanishes_exactly_where_b_is_held(programme, minor, deviator):
    stress = minor + deviator * np.array([1.0, programme.b, 0.0])
    row = programme.controlled_stresses[1]
    assert row @ stress == pytest.approx(0.0, abs=1e-9 * (minor + deviator))
    assert programme.targets(0.1)[1] == 0.0
    # Differences of stresses that may be a thousand times the deviator.
    assert programme.stress_ratio_error(stress) == pytest.approx(0.0, abs=1e-9)
    off = stress + np.array([0.0, 0.1 * deviator, 0.0])
    assert programme.stress_ratio_error(off) == pytest.approx(0.1, abs=1e-9)
    assert abs(row @ off) == pytest.approx(0.1 * deviator, rel=1e-6)


def test_each_family_holds_its_own_stress():
    stress = np.array([9e5, 4e5, 2e5])
    mean = ConstantMeanStress(pressure=5e5, b=0.5)
    minor = ConstantMinorStress(pressure=2e5, b=0.5)
    loops = CyclicTriaxial(
        pressure=2e5, unloading_strains=(0.02,), amplitudes=(0.01,), axial_strain=0.05
    )
    assert mean.stress_error(stress, 0.1) == pytest.approx(0.0, abs=1e-12)
    assert minor.stress_error(stress, 0.1) == pytest.approx(0.0, abs=1e-12)
    assert loops.stress_error(stress, 0.1) == pytest.approx(1.0)  # s22, the worse of the two
    assert math.isnan(loops.intermediate_stress_ratio)
    assert math.isnan(loops.stress_ratio_error(stress))


@given(programme=monotonic, fraction=st.floats(0.0, 1.0))
def test_monotonic_length_is_the_axial_strain(programme, fraction):
    length = fraction * programme.path_length
    np.testing.assert_array_equal(programme.driven_strain(length), [length, 0.0, 0.0])
    assert programme.turning_points == ()


@given(programme=cyclic)
def test_drawn_loops_fill_the_path_length_and_turn_twice_each(programme):
    assert programme.path_length == pytest.approx(DRAWN_PATH_LENGTH, abs=1e-9)
    assert DRAWN_LOOPS[0] <= len(programme.amplitudes) <= DRAWN_LOOPS[1]
    assert all(
        DRAWN_AMPLITUDES[0] - 1e-5 <= by <= DRAWN_AMPLITUDES[1] + 1e-5
        for by in programme.amplitudes
    )
    corners = programme.turning_points
    assert len(corners) == 2 * len(programme.amplitudes)
    stops = (0.0, *corners, programme.path_length)
    assert all(a < b for a, b in itertools.pairwise(stops))
    strains = np.array([programme.driven_strain(s)[0] for s in stops])
    # The driving length is the length of the axial strain's own path, and its rate turns round.
    np.testing.assert_allclose(np.abs(np.diff(strains)), np.diff(stops), atol=1e-12)
    np.testing.assert_array_equal(
        np.sign(np.diff(strains)), [(-1.0) ** k for k in range(len(stops) - 1)]
    )
    assert strains[-1] == pytest.approx(programme.axial_strain, abs=1e-12)
    assert strains.max() <= max(programme.axial_strain, *programme.unloading_strains) + 1e-12


@given(programme=random_strain)
@settings(deadline=None, max_examples=10)
def test_random_strain_is_deviatoric_and_has_the_stated_length(programme):
    lengths = np.linspace(0.0, programme.path_length, TABLE_POINTS // 2)
    strain = np.array([programme.driven_strain(s) for s in lengths])
    np.testing.assert_allclose(strain.sum(axis=1), 0.0, atol=1e-15)
    travelled = np.sqrt(2 / 3) * np.linalg.norm(np.diff(strain, axis=0), axis=1).sum()
    # Chords cut the corners of the tabulated path a little.
    assert travelled == pytest.approx(programme.path_length, rel=1e-3)


@given(programme=random_strain, fraction=st.floats(0.0, 1.02))
@settings(deadline=None)
def test_random_mean_stress_starts_at_p0_and_keeps_its_bounds(programme, fraction):
    p0 = programme.pressure
    assert programme.targets(0.0)[0] == pytest.approx(p0, rel=1e-12)
    p = programme.targets(fraction * programme.path_length)[0]
    assert math.log(programme.lowest_pressure) <= math.log(p / p0)
    assert math.log(p / p0) <= math.log(programme.highest_pressure)
    assert p <= HIGHEST_DRAWN_PRESSURE * (1 + 1e-12)


def test_random_strain_follows_from_its_seed():
    first, same, other = (RandomStrain(pressure=1e6, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.driven_strain(0.05), same.driven_strain(0.05))
    assert not np.allclose(first.driven_strain(0.05), other.driven_strain(0.05))


LOOPS = {"unloading_strains": (0.02,), "amplitudes": (0.01,), "axial_strain": 0.05}


@pytest.mark.parametrize(
    ("family", "fields", "named"),
    [
        *(
            (family, {"b": 0.5, **wrong}, name)
            for family in (ConstantMeanStress, ConstantMinorStress)
            for name, wrong in [
                ("pressure", {"pressure": 0.0}),
                ("pressure", {"pressure": -1e5}),
                ("pressure", {"pressure": math.nan}),
                ("b", {"b": -0.01}),
                ("b", {"b": 1.01}),
                ("b", {"b": math.nan}),
                ("axial_strain", {"axial_strain": 0.0}),
                ("axial_strain", {"axial_strain": 1.5}),
            ]
        ),
        (CyclicTriaxial, LOOPS | {"pressure": 0.0}, "pressure"),
        (CyclicTriaxial, LOOPS | {"unloading_strains": (0.06,)}, "unloading_strains"),
        (CyclicTriaxial, LOOPS | {"unloading_strains": (0.0,)}, "unloading_strains"),
        (CyclicTriaxial, LOOPS | {"amplitudes": (0.0,)}, "amplitudes"),
        (CyclicTriaxial, LOOPS | {"amplitudes": ()}, "amplitudes"),
        (RandomStrain, {"seed": 1, "pressure": -1.0}, "pressure"),
        (RandomStrain, {"seed": -1}, "seed"),
        (RandomStrain, {"seed": 1, "length": 0.0}, "length"),
        (RandomStrain, {"seed": 1, "lowest_pressure": 1.0}, "lowest_pressure"),
        (RandomStrain, {"seed": 1, "highest_pressure": 1.0}, "highest_pressure"),
    ],
)
def test_impossible_programme_is_refused_by_field(family, fields, named):
    with pytest.raises(ConfigurationError, match=rf"{family.__name__}\.{named} = "):
        family(**({"pressure": 5e5} | fields))
