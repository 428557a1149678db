"""`linear-elastic`: isotropic linear elasticity in increments, fitted to the training split."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
import xarray as xr
from torch import Tensor

from granbench.cells.baseline import TrainingRequest
from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.data.splits import select_split
from granbench.errors import ModelError
from granbench.tensors import (
    COMPONENT_ORDERS,
    component_order,
    contraction_weights,
    mean_stress,
    normal_mask,
    volumetric_strain,
)


class LinearElasticCell(MaterialCell):
    """dp = K d(eps_v), ds = 2 G de; the void ratio follows the volumetric strain.

    In the plane p and s are those of the plane, so K is K + G/3 of the solid in plane strain.
    Grains are incompressible compared with the pores, so 1 + e decreases with the volume: for the
    logarithmic strain of particle records, 1 + e = (1 + e0) exp(-eps_v) exactly.

    Parameters
    ----------
    bulk_modulus, shear_modulus : K and G, Pa
    order : component order
    has_void_ratio : whether the records have a void ratio that is to be predicted
    """

    name = "linear-elastic"

    def __init__(
        self,
        bulk_modulus: float,
        shear_modulus: float,
        order: str = "principal",
        *,
        has_void_ratio: bool = True,
    ) -> None:
        self.bulk_modulus = bulk_modulus
        self.shear_modulus = shear_modulus
        self.order = order
        self.internals = ("void_ratio",) if has_void_ratio else ()
        components = len(COMPONENT_ORDERS[order])
        self.layout = StateLayout.of(stress=components, **dict.fromkeys(self.internals, 1))
        self._normal = torch.tensor(normal_mask(order), dtype=self.dtype)

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`; a void ratio that is predicted is needed."""
        known = {name: conditions.require(f"initial_{name}")[:, None] for name in self.internals}
        return self.layout.pack(stress=conditions.stress, **known).to(self.dtype)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        volumetric = volumetric_strain(dstrain, self.order)[:, None]
        deviatoric = dstrain - self._normal * (volumetric / self._normal.sum())
        stress = (
            state[:, self.layout["stress"]]
            + self._normal * (self.bulk_modulus * volumetric)
            + 2.0 * self.shear_modulus * deviatoric
        )
        parts = {
            name: (1.0 + state[:, self.layout[name]]) * torch.exp(-volumetric) - 1.0
            for name in self.internals
        }
        return stress, self.layout.pack(stress=stress, **parts)

    def parameters_count(self) -> int:
        """K and G."""
        return 2


def fitted_moduli(
    strain: np.ndarray, stress: np.ndarray, order: str = "principal"
) -> tuple[float, float]:
    """K and G of the recorded increments by least squares.

    The isotropic and the deviatoric part of the residual are orthogonal, so each modulus has its
    own quotient: K = sum(dp d(eps_v)) / sum(d(eps_v)^2), 2 G = sum(ds:de) / sum(de:de).

    Parameters
    ----------
    strain, stress : (path, step, component), compression positive, Pa
    order : component order

    Raises
    ------
    ModelError
        If the strain never changes in one of the two parts.
    """
    dstrain, dstress = np.diff(strain, axis=1), np.diff(stress, axis=1)
    volumetric, pressure = volumetric_strain(dstrain, order), mean_stress(dstress, order)
    normal = np.array(normal_mask(order))
    count = np.array(contraction_weights(order))
    deviatoric_strain = dstrain - normal * (volumetric[..., None] / normal.sum())
    deviatoric_stress = dstress - normal * pressure[..., None]
    squares = np.sum(volumetric**2), np.sum(count * deviatoric_strain**2)
    if not min(squares) > 0.0:
        raise ModelError(
            "linear-elastic cannot be fitted: the training paths have no volumetric or no "
            "deviatoric strain; use a dataset with both"
        )
    bulk = np.sum(pressure * volumetric) / squares[0]
    twice_shear = np.sum(count * (deviatoric_stress * deviatoric_strain)) / squares[1]
    return float(bulk), float(twice_shear / 2.0)


class LinearElasticBaseline:
    """See `granbench.cells.baseline.Baseline`; two moduli are fitted whenever it is loaded."""

    name = "linear-elastic"
    title = "Linear elasticity, K and G fitted to the training increments"
    presets: Sequence[str] = ()

    def train(self, request: TrainingRequest) -> Path:
        """There is nothing to train."""
        raise ModelError(
            "linear-elastic is fitted in closed form when it is used; use its name as the model"
        )

    def load(self, folder: Path | None, records: xr.Dataset) -> MaterialCell:
        """See `granbench.cells.baseline.Baseline.load`."""
        order = component_order(records["component"].values)
        training = select_split(records, "train")
        strain, stress = (training[name].values.astype(np.float64) for name in ("strain", "stress"))
        return LinearElasticCell(
            *fitted_moduli(strain, stress, order), order, has_void_ratio="void_ratio" in records
        )


BASELINE = LinearElasticBaseline()
