"""A baseline from outside of the package: one file, found by its entry point, scored like others.

The file below is the recipe: a configuration, a network, and the settings it is trained with. The
package that brings it declares, in its `pyproject.toml`,

    [project.entry-points."granbench.baselines"]
    toy = "toy_baseline:BASELINE"
"""

import json
from pathlib import Path

import pytest
from plug_in import granbench, install, python, scores

TOY_BASELINE = '''
"""`toy`: one recurrent layer of four, trained on whole paths."""

from typing import ClassVar

import torch
from pydantic.dataclasses import dataclass
from torch import Tensor, nn

from granbench.baselines.configuration import SETTINGS, Count
from granbench.baselines.training import Recipe
from granbench.baselines.whole_paths import PathBaseline, PathConfiguration, PathNetwork


@dataclass(frozen=True, config=SETTINGS)
class ToyConfiguration(PathConfiguration):
    """Architecture: the width of the hidden state."""

    hidden: Count = 4
    widths: ClassVar[tuple[str, ...]] = ("hidden",)


class ToyNetwork(PathNetwork):
    """One recurrent layer and a linear read-out."""

    def __init__(self, configuration: ToyConfiguration) -> None:
        super().__init__(configuration)
        self.memory = configuration.hidden
        self.recurrent = nn.RNN(configuration.components, self.memory, batch_first=True)
        self.read_out = nn.Linear(self.memory, configuration.components)

    def forward(self, increments: Tensor) -> Tensor:
        """Whole paths, for training."""
        return self.read_out(self.recurrent(increments)[0])

    def advance(self, increment: Tensor, hidden: Tensor) -> tuple[Tensor, Tensor]:
        """One step, for the material cell."""
        hidden = torch.rnn_tanh_cell(increment, hidden, *self.recurrent.all_weights[0])
        return self.read_out(hidden), hidden


BASELINE = PathBaseline(
    name="toy",
    title="Recurrent layer of four",
    settings={"reference": (ToyConfiguration(), Recipe(batch_size=50, epochs=30))},
    configuration_type=ToyConfiguration,
    network_type=ToyNetwork,
)
'''

ENTRY_POINT = "toy = toy_baseline:BASELINE"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """The folder of the package with the baseline."""
    install(tmp_path, {"toy_baseline.py": TOY_BASELINE}, "granbench.baselines", ENTRY_POINT)
    return tmp_path


def test_a_plug_in_baseline_is_trained_and_scored(installed: Path) -> None:
    task = ("--task", "dem-triaxial-mini")
    granbench(installed, "train", "toy", *task, "--epochs", 1, "--out", "toy")
    description = json.loads((installed / "toy" / "model.json").read_text())
    assert description["baseline"] == "toy"
    assert description["training"]["epochs"] == 1
    words = ("--axis", "rollout", "--seeds", "0", "--out", "card.json", "--quiet")
    granbench(installed, "evaluate", "toy", *task, *words)
    found = scores(installed / "card.json", metric="stress_mse_mean", status="scored")
    assert found
    assert all(score["value"] > 0.0 for score in found)


def test_stepping_the_cell_agrees_with_the_network_on_whole_paths(installed: Path) -> None:
    program = """
import torch
from granbench.cells.baseline import find_baseline
from granbench.cells.contract import Conditions

toy = find_baseline("toy")
configuration, _ = toy.settings["reference"]
network = toy.seeded_network(configuration, seed=0)
strain = torch.linspace(0.0, 0.01, 9)[None, :, None].expand(2, 9, 3).cumsum(dim=1)
network.fit_scaling(strain, 1e5 + 1e6 * strain.square())
conditions = Conditions(torch.full((2, 3), 1e5))
with torch.no_grad():
    whole = network(strain.diff(dim=1) / network.increment_scale)
    whole = network.stress_mean + network.stress_scale * whole
stepped = toy.cell(network).rollout(strain, conditions).stress[:, 1:]
torch.testing.assert_close(stepped, whole, rtol=1e-5, atol=1.0)
"""
    python(installed, program)
