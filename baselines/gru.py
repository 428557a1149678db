"""`gru`: two GRU layers of 30 from strain increments to stress, trained on whole paths (Sec 6.3).

The only input is the strain increment: the network knows neither pressure nor density and cannot
predict a path that starts from another stress than the training paths. With the output `change`
it gives the change of stress from the start: enough for a material that does not depend on the
pressure.

References
----------
Guan (2023), Sec 6.3; Cho et al. (2014), Learning phrase representations using RNN
encoder-decoder for statistical machine translation: the gated recurrent unit (GRU).
"""

from typing import ClassVar

import torch
from pydantic.dataclasses import dataclass
from torch import Tensor, nn

from granbench.baselines.configuration import SETTINGS, Count
from granbench.baselines.training import Recipe
from granbench.baselines.whole_paths import Output, PathBaseline, PathConfiguration, PathNetwork


@dataclass(frozen=True, config=SETTINGS)
class GruConfiguration(PathConfiguration):
    """Architecture of a `gru`; the defaults are those of Sec 6.3.

    Parameters
    ----------
    order : component order of strain and stress, that of the training records
    hidden : width of the hidden state of each layer
    layers : number of GRU layers
    output : the stress itself (`absolute`, the thesis), or its change since the start of the path
        (`change`)
    """

    hidden: Count = 30
    layers: Count = 2
    output: Output = "absolute"
    widths: ClassVar[tuple[str, ...]] = ("layers", "hidden")


class GruNetwork(PathNetwork):
    """GRU layers and a linear read-out."""

    def __init__(self, configuration: GruConfiguration) -> None:
        super().__init__(configuration)
        count = configuration.components
        self.memory = configuration.hidden * configuration.layers
        self.recurrent = nn.GRU(count, configuration.hidden, configuration.layers, batch_first=True)
        self.read_out = nn.Linear(configuration.hidden, count)

    def forward(self, increments: Tensor) -> Tensor:
        """See `PathNetwork.forward`."""
        return self.read_out(self.recurrent(increments)[0])

    def step_module(self) -> nn.Module:
        """See `PathNetwork.step_module`: several times as fast as the modules above."""
        return _Step(self)


class _LayerStep(nn.Module):
    """One step of a GRU layer, in rows (unit, point), with a copy of its present weights.

        r, z = sigmoid(W [x; h] + b),   n = tanh(W_x x + b_x + r (W_h h + b_h)),   n + z (h - n)

    All products are one, with a matrix whose rows belong to r, z, W_x x and W_h h. The latter two
    are doubled: tanh(a) = 2 sigmoid(2 a) - 1, and torch's tanh takes ten times as long.
    """

    weight: Tensor
    bias: Tensor

    def __init__(
        self, of_input: Tensor, of_hidden: Tensor, input_bias: Tensor, hidden_bias: Tensor
    ) -> None:
        super().__init__()
        width = of_hidden.shape[1]
        gates, new = slice(0, 2 * width), slice(2 * width, None)
        none_of_input, none_of_hidden = torch.zeros_like(of_input), torch.zeros_like(of_hidden)
        from_input = [of_input[gates], 2.0 * of_input[new], none_of_input[new]]
        from_hidden = [of_hidden[gates], none_of_hidden[new], 2.0 * of_hidden[new]]
        biases = [(input_bias + hidden_bias)[gates], 2.0 * input_bias[new], 2.0 * hidden_bias[new]]
        weight = torch.cat([torch.cat(from_input), torch.cat(from_hidden)], dim=1)
        self.register_buffer("weight", weight)
        self.register_buffer("bias", torch.cat(biases).unsqueeze(-1))
        self.gates = 2 * width

    def forward(self, below: Tensor, before: Tensor) -> Tensor:
        """Hidden state after the step, from the layer below and the hidden state before."""
        sums = torch.addmm(self.bias, self.weight, torch.cat([below, before]))
        reset, update = torch.sigmoid(sums[: self.gates]).chunk(2)
        of_input, of_hidden = sums[self.gates :].chunk(2)
        half = torch.sigmoid(torch.addcmul(of_input, reset, of_hidden))
        return torch.lerp(half + half - 1.0, before, update)


class _Step(nn.Module):
    """One step of a `GruNetwork`, in rows (unit, point), with a copy of its present weights.

    Modules and buffers, so that all of it is converted to double precision with the cell.
    """

    increment_scale: Tensor
    stress_weight: Tensor
    stress_bias: Tensor

    def __init__(self, network: GruNetwork) -> None:
        super().__init__()
        scale, read_out = network.stress_scale, network.read_out
        bias = torch.addcmul(network.stress_mean, scale, read_out.bias)
        self.layers = nn.ModuleList(
            _LayerStep(*weights) for weights in network.recurrent.all_weights
        )
        self.register_buffer("increment_scale", network.increment_scale.clone().unsqueeze(-1))
        self.register_buffer("stress_weight", scale.unsqueeze(-1) * read_out.weight)
        self.register_buffer("stress_bias", bias.unsqueeze(-1))

    def forward(self, dstrain: Tensor, hidden: Tensor) -> tuple[Tensor, list[Tensor]]:
        """Stress, or its change since the start, Pa, and the hidden state of each layer after."""
        below, after = dstrain / self.increment_scale, []
        for layer, before in zip(self.layers, hidden.chunk(len(self.layers)), strict=True):
            below = layer(below, before)
            after.append(below)
        return torch.addmm(self.stress_bias, self.stress_weight, below), after


_RECIPE = Recipe(
    batch_size=50,
    learning_rate=1e-2,
    schedule="one-cycle",
    largest_gradient=1.0,
    epochs=300,
    patience=300,
)

BASELINE = PathBaseline(
    name="gru",
    title="GRU, two layers of 30 (Guan 2023, Sec 6.3)",
    settings={
        "reference": (GruConfiguration(), _RECIPE),
        # For starts under different pressures.
        "change": (GruConfiguration(output="change"), _RECIPE),
        # The thesis: all paths in one batch, a constant rate, 1e5 epochs.
        "paper": (GruConfiguration(), Recipe(batch_size=1000, epochs=100_000)),
    },
    configuration_type=GruConfiguration,
    network_type=GruNetwork,
)
