"""Analyse a rigid strip footing on a user-defined model.

``python footing_on_a_model.py`` writes footing.nc and footing.png to the current folder. In the
folder of this file, the same can be done with
``granbench fem strip-footing --cell footing_on_a_model:cell --out footing.nc --plot footing.png``.
"""

import torch

from granbench.cells import ModuleCell
from granbench.fem import ImplicitSettings, find_problem, run
from granbench.plotting.fem import analysis_figure
from granbench.plotting.style import save_figure


class Softening(torch.nn.Module):
    """Elastic, with a shear stress that tends to a limit."""

    def forward(self, dstrain, stress):
        """Stress after a strain increment; all are (point, component), compression positive."""
        difference = torch.hypot(stress[:, 0] - stress[:, 1], 2.0 * stress[:, 2])
        shear = 10e6 * torch.exp(-difference / 50e3).unsqueeze(1)
        volume = 0.5 * (dstrain[:, :2].sum(dim=1, keepdim=True)) * torch.tensor([1.0, 1.0, 0.0])
        return stress + 60e6 * volume + 2.0 * shear * (dstrain - volume)


def cell():
    """The module as a material cell; `granbench fem --cell` calls this."""
    return ModuleCell(Softening(), name="softening", order="plane", dtype=torch.float64)


if __name__ == "__main__":
    problem = find_problem("strip-footing", end_strain=0.03)
    analysis = run(problem, cell(), solver=ImplicitSettings(steps=60), mesh="coarse")
    analysis.write("footing.nc")
    footing = analysis.check()
    save_figure(analysis_figure(footing), "footing.png")
    print(f"half of the footing carries {float(footing['reaction'][-1]) / 1e3:.1f} kN/m")
