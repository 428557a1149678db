"""Laboratory tests as batches for a fit: what drives the model, and the measured values to compare.

A batch holds tests of one kind of control, so that all of them run at once; the compared quantities
are linear in stress and strain, so that one code serves every kind of control.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch

from granbench.cells.contract import Conditions
from granbench.errors import ConfigurationError, Setting
from granbench.fitting.settings import CONTROLS
from granbench.fitting.test_batch import Floats, TestBatch
from granbench.laboratory import LaboratoryTest
from granbench.laboratory.laboratory_test import HELD_LATERAL_STRESS
from granbench.paths.mixed_control import MixedControl
from granbench.tensors import COMPONENT_ORDERS

LARGEST_STRESS_STEP = 1.3
"""Largest factor by which the axial stress of an oedometer test changes in a step: the tests double
their loads, which is too much for one increment."""
VOLUME_FLOOR = 0.02
"""Smallest range of the volumetric strain, as a share of the axial strain: a volume that hardly
changes would be compared with its own noise."""

MIXED_QUANTITIES = ("deviatoric_stress", "volumetric_strain")


def batches_of(
    tests: Sequence[LaboratoryTest],
    *,
    control: str = "auto",
    points: int | None = None,
    weights: Mapping[str, float] | None = None,
) -> list[TestBatch]:
    """Laboratory tests as batches, one for each kind of control.

    Parameters
    ----------
    tests : in any order
    control : `strain`: the measured strain drives, all stresses are compared. `mixed`: the axial
        strain drives, the lateral stresses are held at what was measured, q and the volumetric
        strain are compared. `auto`: mixed where the lateral stress was prescribed, because there
        the stiffness would amplify the noise of the measured lateral strain.
        An oedometer test whose lateral stress was not measured is driven by its axial stress, and
        its axial strain is compared.
    points : to which a test is thinned; None for all
    weights : of quantities by name; 1 by default

    Raises
    ------
    ConfigurationError
        If the control is unknown or impossible for a test, or a weight is out of range.
    """
    if control not in CONTROLS:
        raise ConfigurationError(
            Setting("control", control), f" is unknown; use {', '.join(CONTROLS)}"
        )
    groups: dict[str, list[LaboratoryTest]] = {"mixed": [], "strain": [], "oedometer": []}
    for test in tests:
        groups[_control_of(test, control)].append(test if points is None else test.thinned(points))
    made = {"mixed": _mixed_batch, "strain": _strain_batch, "oedometer": _oedometer_batch}
    batches = [made[kind](members) for kind, members in groups.items() if members]
    return [_weighted(batch, weights or {}, batches) for batch in batches]


def _control_of(test: LaboratoryTest, control: str) -> str:
    if not test.lateral_stress_known:
        if control != "auto":
            raise ConfigurationError(
                f"{test.source}: its lateral stress was not measured, so its axial stress drives "
                "the model; use ",
                Setting("control", "auto"),
            )
        return "oedometer"
    held = test.kind in HELD_LATERAL_STRESS
    if control == "auto":
        return "mixed" if held else "strain"
    if control == "mixed" and not held:
        raise ConfigurationError(
            f"{test.source}: a test of the kind {test.kind} prescribes its lateral strain, so its "
            "lateral stress cannot be held; use ",
            Setting("control", "strain"),
            " or auto",
        )
    if control == "strain" and not test.lateral_strain_known:
        raise ConfigurationError(
            f"{test.source}: its lateral strain was not measured, so it cannot drive the model; "
            "use ",
            Setting("control", "mixed"),
            " or auto",
        )
    return control


def _stacked(series: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Series (step, ...) of several lengths as one (test, step, ...), and which steps are real."""
    longest = max(map(len, series))
    real = np.array([np.arange(longest) < len(one) for one in series])
    padded = [np.concatenate([one, np.repeat(one[-1:], longest - len(one), 0)]) for one in series]
    return np.stack(padded), real.astype(float)


def _conditions(tests: Sequence[LaboratoryTest]) -> Conditions:
    stress = torch.from_numpy(np.stack([test.stress[0] for test in tests]))
    scalars = {"initial_mean_stress": [test.initial_mean_stress for test in tests]}
    void_ratios = [test.initial_void_ratio for test in tests if test.initial_void_ratio is not None]
    if len(void_ratios) == len(tests):
        scalars["initial_void_ratio"] = void_ratios
    return Conditions(
        stress, {name: torch.tensor(values).double() for name, values in scalars.items()}
    )


def _strain_batch(tests: Sequence[LaboratoryTest]) -> TestBatch:
    strain, real = _stacked([test.strain for test in tests])
    stress, _ = _stacked([test.stress for test in tests])
    return strain_batch(
        "principal", [test.name for test in tests], strain, stress, _conditions(tests), real
    )


def strain_batch(
    order: str,
    names: Sequence[str],
    strain: Floats,
    stress: Floats,
    conditions: Conditions,
    real: Floats | None = None,
) -> TestBatch:
    """Strain-driven paths of any component order, such as those of a dataset.

    Parameters
    ----------
    order : component order
    names : of the paths
    strain, stress : (path, step, component), cumulative; Pa
    conditions : at step 0
    real : (path, step), 0 where a path only repeats its last point; all count by default
    """
    components = COMPONENT_ORDERS[order]
    count = len(components)
    # One scale for all components, or the noise of a constant one would be amplified.
    scale = np.ptp(stress, axis=1).max(axis=1, keepdims=True)
    largest = np.abs(stress).max(axis=(1, 2))[:, None]
    scale = np.where(scale > 0.0, scale, np.where(largest > 0.0, largest, 1.0))
    weight = np.ones(stress.shape[:2]) if real is None else real.copy()
    weight[:, 0] = 0.0
    return TestBatch(
        tuple(names),
        "strain",
        MixedControl.of_strain(order, strain),
        conditions,
        tuple(f"stress_{label}" for label in components),
        torch.eye(count, dtype=torch.float64),
        torch.zeros(count, count, dtype=torch.float64),
        torch.from_numpy(np.array(stress, dtype=float)),
        torch.from_numpy(np.repeat(scale, count, axis=1)),
        torch.from_numpy(np.repeat(weight[..., None], count, axis=2)),
    )


def _mixed_batch(tests: Sequence[LaboratoryTest]) -> TestBatch:
    strain, real = _stacked([test.strain for test in tests])
    stress, _ = _stacked([test.stress for test in tests])
    control = MixedControl.together(
        [
            MixedControl.of_components("principal", ("22", "33"), *pair)
            for pair in zip(strain, stress, strict=True)
        ]
    )
    observed = np.stack([stress[..., 0] - stress[..., 2], strain.sum(axis=-1)], axis=-1)
    known = np.isfinite(observed)
    observed = np.where(known, observed, 0.0)
    scale = np.ptp(observed, axis=1)
    axial = np.ptp(strain[..., 0], axis=1)
    scale[:, 0] = np.where(scale[:, 0] > 0.0, scale[:, 0], np.abs(stress).max(axis=(1, 2)))
    scale[:, 1] = np.maximum(scale[:, 1], VOLUME_FLOOR * axial)
    weight = real[..., None] * known
    weight[:, 0] = 0.0
    return TestBatch(
        tuple(test.name for test in tests),
        "mixed",
        control,
        _conditions(tests),
        MIXED_QUANTITIES,
        torch.tensor([[1.0, 0.0, -1.0], [0.0, 0.0, 0.0]], dtype=torch.float64),
        torch.tensor([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], dtype=torch.float64),
        torch.from_numpy(observed),
        torch.from_numpy(scale),
        torch.from_numpy(weight),
    )


def _oedometer_batch(tests: Sequence[LaboratoryTest]) -> TestBatch:
    stresses, strains, weights = zip(*map(_oedometer_steps, tests), strict=True)
    stress, _ = _stacked(stresses)
    strain, _ = _stacked(strains)
    weight, real = _stacked(weights)
    zero = np.zeros((*stress.shape[1:], 3))
    control = MixedControl.together(
        [
            MixedControl.of_components("principal", ("11",), zero, zero + one[:, None])
            for one in stress
        ]
    )
    return TestBatch(
        tuple(test.name for test in tests),
        "oedometer",
        control,
        _conditions(tests),
        ("axial_strain",),
        torch.zeros(1, 3, dtype=torch.float64),
        torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64),
        torch.from_numpy(strain[..., None]),
        torch.from_numpy(np.ptp(strain, axis=1)[:, None]),
        torch.from_numpy((weight * real)[..., None]),
    )


def _oedometer_steps(test: LaboratoryTest) -> tuple[Floats, Floats, Floats]:
    """Axial stress and strain of each step, (step,), and weight: 0 where nothing was measured.

    Between measured points the stress goes in even factors.
    """
    logarithm = np.log(test.stress[:, 0])
    parts = np.ceil(np.abs(np.diff(logarithm)) / np.log(LARGEST_STRESS_STEP)).astype(int).clip(1)
    rows = np.concatenate([[0], np.cumsum(parts)])
    steps = np.arange(rows[-1] + 1)
    weight = np.zeros(len(steps))
    weight[rows[1:]] = 1.0
    stress = np.exp(np.interp(steps, rows, logarithm))
    stress[rows] = test.stress[:, 0]
    return stress, np.interp(steps, rows, test.axial_strain), weight


def _weighted(
    batch: TestBatch, weights: Mapping[str, float], batches: Sequence[TestBatch]
) -> TestBatch:
    """The batch with the given weights of its quantities."""
    known = [name for one in batches for name in one.quantities]
    for name, value in weights.items():
        if name not in known:
            raise ConfigurationError(
                Setting("weights", {name: value}),
                f": there is no quantity {name!r} in these tests; use "
                f"{', '.join(dict.fromkeys(known))}",
            )
        if not 0.0 <= value < float("inf"):
            raise ConfigurationError(
                Setting("weights", {name: value}), " must be finite and not negative"
            )
    factors = torch.tensor([weights.get(name, 1.0) for name in batch.quantities]).double()
    weight = batch.weight * factors
    if not (weight > 0.0).flatten(1).any(dim=1).all():
        raise ConfigurationError(
            Setting("weights"),
            " of all quantities of a test are zero; give one of them a weight above 0",
        )
    return replace(batch, weight=weight)
