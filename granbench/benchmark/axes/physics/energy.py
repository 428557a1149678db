"""Work over closed strain cycles: a material cannot give work away cycle after cycle."""

import torch
from torch import Tensor

from granbench.cells.contract import Conditions, MaterialCell
from granbench.cells.robust_runs import robust_rollout
from granbench.tensors import contraction_weights


def cycle_work(cell: MaterialCell, strain: Tensor, conditions: Conditions) -> Tensor:
    """Net work of the second of two identical strain cycles: the path and the same way back.

    W = closed integral of sigma : d eps, by the trapezoidal rule. In an elastic cycle it is
    exactly zero, because the way back meets the stresses of the way out. The first cycle releases
    what was stored at the start; a material whose second cycle gives work away would do so for
    ever.

    Parameters
    ----------
    strain : (path, step, component), cumulative, compression positive
    conditions : at step 0

    Returns
    -------
    (path,), J/m3 = Pa, positive where the material consumes work; NaN where the run broke down
    """
    back = strain.flip(1)[:, 1:]
    cycle = torch.cat([strain, back], dim=1)
    stress = robust_rollout(cell, torch.cat([cycle, cycle[:, 1:]], dim=1), conditions)["stress"]
    second = stress[:, cycle.shape[1] - 1 :]
    weights = torch.tensor(contraction_weights(cell.order), dtype=torch.float64)
    mean = 0.5 * (second[:, 1:] + second[:, :-1])
    return (mean * cycle.diff(dim=1) * weights).sum(dim=(1, 2))
