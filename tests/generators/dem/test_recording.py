"""The record of a test: no lag, nothing lost between records, and the limits of the dataset."""

import dataclasses
import itertools

import numpy as np
import pytest

from granbench.generators.dem.measurement import Contacts
from granbench.generators.dem.recording import (
    LARGEST_INERTIAL_NUMBER,
    LARGEST_RATIO_ERROR,
    LARGEST_SERVO_ERROR,
    Chunk,
    DrivenSeries,
    QualityError,
    Snapshot,
    record_of,
    require_quality,
    stress_tensor,
)
from granbench.paths import ConstantMeanStress

PRESSURE = 5e5
PROGRAMME = ConstantMeanStress(pressure=PRESSURE, b=0.5, axial_strain=0.03)
POSITIONS = np.linspace(0.0, 0.03, 11)
SLOPE = np.array([4e6, 0.0, -4e6, 3e5, -2e5, 1e5])
"""Change of stress per driving length, which keeps p and b as prescribed."""


def stress_at(position):
    return np.array([PRESSURE] * 3 + [0.0] * 3) + SLOPE * position


def series_of(stress=stress_at, chunks_a_record=3):
    """Measurements during a test whose stress is the function `stress_at` of the driving length."""

    def chunks(low, high):
        edges = np.linspace(low, high, chunks_a_record + 1)
        return [
            Chunk(a, b, stress(0.5 * (a + b)), 1e-3 + 1e-2 * b, 7)
            for a, b in itertools.pairwise(edges)
        ]

    contacts = Contacts(np.eye(3), grain_count=2)
    return DrivenSeries(
        positions=POSITIONS,
        snapshots=[Snapshot(np.array([s, 0.0, -s]), 0.6 + s, contacts) for s in POSITIONS],
        initial_stress=stress(0.0),
        chunks=[c for ends in itertools.pairwise(POSITIONS) for c in chunks(*ends)],
        beyond=chunks(0.03, 0.033),
    )


@pytest.mark.parametrize("chunks_a_record", [1, 3, 4])
def test_stress_that_is_linear_in_the_path_is_recorded_without_lag(chunks_a_record):
    """Although every average is known half a chunk late, even at the last record."""
    record = record_of(PROGRAMME, series_of(chunks_a_record=chunks_a_record))
    expected = np.array([stress_at(s) for s in POSITIONS])
    np.testing.assert_allclose(record.stress, expected, rtol=1e-12, atol=1e-6)


def test_geometry_is_that_of_the_record():
    record = record_of(PROGRAMME, series_of())
    np.testing.assert_array_equal(record.strain[:, 0], POSITIONS)
    np.testing.assert_array_equal(record.void_ratio, 0.6 + POSITIONS)
    np.testing.assert_array_equal(record.coordination_number, 3.0)  # 2 x 3 contacts / 2 grains


def test_inertial_number_is_the_largest_since_the_last_record():
    record = record_of(PROGRAMME, series_of())
    # It increases along the path, so that the last chunk before each record has the largest.
    np.testing.assert_allclose(record.inertial_number[1:], 1e-3 + 1e-2 * POSITIONS[1:])
    assert record.inertial_number[0] == 0
    assert record.peak_inertial_number == record.inertial_number[-1]


def test_steps_are_those_up_to_the_last_record():
    assert record_of(PROGRAMME, series_of()).steps == 7 * 3 * (len(POSITIONS) - 1)


def test_errors_before_the_servo_has_settled_do_not_count():
    def settling(position, until):
        return stress_at(position) * (1.05 if position < until else 1.0)

    soon = record_of(PROGRAMME, series_of(lambda s: settling(s, until=2e-3)))
    late = record_of(PROGRAMME, series_of(lambda s: settling(s, until=4e-3)))
    assert soon.servo_error_rms == pytest.approx(0.0, abs=1e-12)
    assert late.servo_error_rms > LARGEST_SERVO_ERROR
    # Of 28 chunks that count, 2 have an error of 5 %.
    assert late.servo_error_rms == pytest.approx(0.05 * np.sqrt(2 / 28), rel=1e-6)


GOOD = record_of(PROGRAMME, series_of())


def test_record_within_all_limits_passes():
    require_quality(GOOD)


@pytest.mark.parametrize(
    ("broken", "named"),
    [
        ({"servo_error_rms": 1.01 * LARGEST_SERVO_ERROR}, "servo error"),
        ({"stress_ratio_error_rms": 1.01 * LARGEST_RATIO_ERROR}, "error of b"),
        ({"peak_inertial_number": 1.01 * LARGEST_INERTIAL_NUMBER}, "inertial number"),
        # All normal stresses are compressive here; shear makes a principal one tensile.
        ({"stress": np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 1.1]])}, "tensile"),
    ],
)
def test_record_beyond_a_limit_is_refused_by_its_name(broken, named):
    with pytest.raises(QualityError, match=named):
        require_quality(dataclasses.replace(GOOD, **broken))


def test_stress_tensor_has_the_full_order():
    tensor = stress_tensor(np.arange(6.0))
    xx, yy, zz, yz, xz, xy = range(6)
    np.testing.assert_array_equal(tensor, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
