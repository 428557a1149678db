"""`linear-elastic`: isotropic linear elasticity in increments, fitted to the training split."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.baseline import TrainingRequest
from granbench.cell import Conditions, MaterialCell, StateLayout
from granbench.data.splits import select_split
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS, mean_stress, volumetric_strain


class LinearElasticCell(MaterialCell):
    """dp = K d(eps_v), ds = 2 G de; the void ratio follows the volumetric strain.

    Grains are incompressible beside the pores, so 1 + e shrinks with the volume: for the
    logarithmic strain of the records, 1 + e = (1 + e0) exp(-eps_v) exactly.

    Parameters
    ----------
    bulk_modulus, shear_modulus : K and G, Pa
    """

    name = "linear-elastic"
    layout = StateLayout.of(stress=3, void_ratio=1)
    internals = ("void_ratio",)

    def __init__(self, bulk_modulus: float, shear_modulus: float) -> None:
        self.bulk_modulus = bulk_modulus
        self.shear_modulus = shear_modulus

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`; the void ratio is needed."""
        void_ratio = conditions.require("initial_void_ratio")[:, None]
        return self.layout.pack(stress=conditions.stress, void_ratio=void_ratio).to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        volumetric = volumetric_strain(dstrain)[:, None]
        deviatoric = dstrain - volumetric / 3.0
        stress = (
            state[:, self.layout["stress"]]
            + self.bulk_modulus * volumetric
            + 2.0 * self.shear_modulus * deviatoric
        )
        void_ratio = (1.0 + state[:, self.layout["void_ratio"]]) * torch.exp(-volumetric) - 1.0
        return stress, self.layout.pack(stress=stress, void_ratio=void_ratio)

    def parameters_count(self) -> int:
        """K and G."""
        return 2


def fitted_moduli(strain: np.ndarray, stress: np.ndarray) -> tuple[float, float]:
    """K and G that fit the recorded increments best, in the least-squares sense.

    The isotropic and the deviatoric part of the residual are orthogonal, so each modulus has
    its own quotient: K = sum(dp d(eps_v)) / sum(d(eps_v)^2), 2 G = sum(ds:de) / sum(de:de).

    Parameters
    ----------
    strain, stress : (path, step, 3), compression positive, Pa

    Raises
    ------
    ModelError
        If the strain never changes in one of the two parts.
    """
    dstrain, dstress = np.diff(strain, axis=1), np.diff(stress, axis=1)
    volumetric, pressure = volumetric_strain(dstrain), mean_stress(dstress)
    deviatoric_strain = dstrain - volumetric[..., None] / 3.0
    deviatoric_stress = dstress - pressure[..., None]
    squares = np.sum(volumetric**2), np.sum(deviatoric_strain**2)
    if not min(squares) > 0.0:
        raise ModelError(
            "linear-elastic cannot be fitted: the training paths never change in volume or in "
            "shape; use a dataset that does both"
        )
    bulk = np.sum(pressure * volumetric) / squares[0]
    twice_shear = np.sum(deviatoric_stress * deviatoric_strain) / squares[1]
    return float(bulk), float(twice_shear / 2.0)


class LinearElasticBaseline:
    """See `granbench.baseline.Baseline`; two moduli are fitted whenever it is loaded."""

    name = "linear-elastic"
    title = "Linear elasticity, K and G fitted to the training increments"
    presets: Sequence[str] = ()

    def train(self, request: TrainingRequest) -> Path:
        """There is nothing to train."""
        raise ModelError(
            "linear-elastic is fitted in closed form when it is used; use its name as the model"
        )

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.baseline.Baseline.load`."""
        labels = tuple(str(label) for label in records["component"].values)
        if labels != COMPONENT_ORDERS["principal"]:
            raise ModelError(
                f"linear-elastic works on principal components, but the records have "
                f"{', '.join(labels)}"
            )
        training = select_split(records, "train")
        return LinearElasticCell(
            *fitted_moduli(
                training["strain"].values.astype(np.float64),
                training["stress"].values.astype(np.float64),
            )
        )


BASELINE = LinearElasticBaseline()
