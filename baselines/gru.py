"""`gru`: two GRU layers of 30 from strain increments to stress, trained on whole paths (Sec 6.3).

The network is shown nothing but strain increments: what the material remembers is in its hidden
state, which starts at zero, and the stress is read from it. So it is told neither pressure nor
density, and a path that starts elsewhere than those it was trained on is beyond it. With the output
`change` the stress is read as its change from the start: enough for a material that does not feel
the pressure.

References
----------
Guan (2023), Sec 6.3; Cho et al. (2014), Learning phrase representations using RNN
encoder-decoder for statistical machine translation.
"""

from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

import torch
import xarray as xr
from torch import Tensor, nn

from granbench.baselines.network_baseline import NetworkBaseline
from granbench.baselines.training import Recipe
from granbench.baselines.training.batches import Batch, BatchSource, ResidentBatches
from granbench.cells.contract import Conditions, MaterialCell, StateLayout
from granbench.data.adapters import history_of
from granbench.errors import ModelError
from granbench.tensors import COMPONENT_ORDERS, component_order

OUTPUTS = ("absolute", "change")


@dataclass(frozen=True)
class GruConfiguration:
    """Architecture of a `gru`; the defaults are those of Sec 6.3.

    Parameters
    ----------
    order : component order of strain and stress, that of the records it is trained on
    hidden : width of each layer's hidden state
    layers : number of GRU layers
    output : what the last layer stands for: the stress itself (`absolute`, the thesis), or its
        change since the path's start (`change`)

    Raises
    ------
    ModelError
        If a setting is out of range.
    """

    order: str = "plane"
    hidden: int = 30
    layers: int = 2
    output: Literal["absolute", "change"] = "absolute"

    def __post_init__(self) -> None:
        if not isinstance(self.order, str) or self.order not in COMPONENT_ORDERS:
            raise ModelError(
                f"unknown component order {self.order!r}; use {', '.join(COMPONENT_ORDERS)}"
            )
        for name in ("hidden", "layers"):
            width = getattr(self, name)
            if isinstance(width, bool) or not isinstance(width, int) or width < 1:
                raise ModelError(f"{name} is {width!r}; it must be an integer of at least 1")
        if self.output not in OUTPUTS:
            raise ModelError(f"unknown output {self.output!r}; use {', '.join(OUTPUTS)}")

    @classmethod
    def of(cls, settings: dict[str, Any]) -> "GruConfiguration":
        """From the settings in a model file.

        Raises
        ------
        ModelError
            If a setting is unknown or out of range.
        """
        if unknown := sorted(set(settings) - {field.name for field in fields(cls)}):
            raise ModelError(f"unknown setting {unknown[0]!r} of a gru")
        return cls(**settings)

    def as_dict(self) -> dict[str, Any]:
        """Settings by name, for a file."""
        return asdict(self)

    def sizes(self) -> dict[str, int]:
        """See `granbench.baselines.network_baseline.Configuration.sizes`."""
        return {"layers": self.layers, "hidden": self.hidden}

    @property
    def components(self) -> int:
        """Number of strain and stress components."""
        return len(COMPONENT_ORDERS[self.order])

    def target(self, stress: Tensor) -> Tensor:
        """What the last layer stands for, for stresses (path, step, component) from the start."""
        return stress if self.output == "absolute" else stress - stress[:, :1]


class GruNetwork(nn.Module):
    """Standardised strain increments to standardised stress, or change of stress.

    Means and standard deviations are buffers, so that they travel with the weights.
    """

    increment_scale: Tensor
    stress_mean: Tensor
    stress_scale: Tensor

    def __init__(self, configuration: GruConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        count = configuration.components
        for name in ("increment_scale", "stress_scale"):
            self.register_buffer(name, torch.ones(count))
        self.register_buffer("stress_mean", torch.zeros(count))
        self.recurrent = nn.GRU(count, configuration.hidden, configuration.layers, batch_first=True)
        self.read_out = nn.Linear(configuration.hidden, count)

    def fit_scaling(self, strain: Tensor, stress: Tensor) -> None:
        """Set means and standard deviations from records (path, step, component).

        Increments are divided only, so that no strain stays zero.
        """
        self.increment_scale.copy_(_varying(strain.diff(dim=1).flatten(0, 1).std(dim=0)))
        target = self.configuration.target(stress).flatten(0, 1)
        self.stress_mean.copy_(target.mean(dim=0))
        self.stress_scale.copy_(_varying(target.std(dim=0)))

    def forward(self, increments: Tensor) -> Tensor:
        """Standardised stress (path, step, component) after each of the increments."""
        return self.read_out(self.recurrent(increments)[0])

    def loss(self, batch: Batch) -> Tensor:
        """Mean squared error of standardised stress over all steps."""
        increments, stress = batch
        return (self(increments) - stress).square().mean()


def _varying(deviation: Tensor) -> Tensor:
    return torch.where(deviation > 0.0, deviation, 1.0)


class _LayerStep(nn.Module):
    """One step of a GRU layer, in rows (unit, point), of its weights as they are now.

        r, z = sigmoid(W [x; h] + b),   n = tanh(W_x x + b_x + r (W_h h + b_h)),   n + z (h - n)

    All products are one, of a matrix whose rows are those of r, z, W_x x and W_h h. The latter two
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
        """Hidden state after the step, of the layer below and of the hidden state before."""
        sums = torch.addmm(self.bias, self.weight, torch.cat([below, before]))
        reset, update = torch.sigmoid(sums[: self.gates]).chunk(2)
        of_input, of_hidden = sums[self.gates :].chunk(2)
        half = torch.sigmoid(torch.addcmul(of_input, reset, of_hidden))
        return torch.lerp(half + half - 1.0, before, update)


class _Step(nn.Module):
    """One step of a `GruNetwork`, in rows (unit, point); a copy of its weights as they are now.

    Modules and buffers, so that whoever wants the cell in double precision gets all of it.
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
        """Stress, or its change since the start, Pa, and each layer's hidden state after."""
        below, after = dstrain / self.increment_scale, []
        for layer, before in zip(self.layers, hidden.chunk(len(self.layers)), strict=True):
            below = layer(below, before)
            after.append(below)
        return torch.addmm(self.stress_bias, self.stress_weight, below), after


class GruCell(MaterialCell):
    """A trained `GruNetwork` as a material cell.

    Its state is stress and hidden state, and the stress at the start where the output is a change
    from it. The first stress is what the conditions say; no later one is read from the state, so
    that a true stress given on the way changes nothing.

    Parameters
    ----------
    network : trained; it is put into evaluation mode, and what changes in it later has no effect
    name : what the leaderboard calls it
    """

    def __init__(self, network: GruNetwork, name: str) -> None:
        self.network = network.eval().requires_grad_(False)
        self.name = name
        self.order = network.configuration.order
        self.dtype = network.stress_mean.dtype
        configuration = network.configuration
        widths = {"stress": configuration.components}
        widths["hidden"] = configuration.hidden * configuration.layers
        self._from_start = configuration.output == "change"
        if self._from_start:
            widths["initial_stress"] = configuration.components
        self.layout = StateLayout.of(**widths)
        self._step = _Step(self.network)

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`."""
        stress = conditions.stress.to(self.dtype)
        hidden = self.layout["hidden"]
        slices = {"stress": stress}
        slices["hidden"] = stress.new_zeros(len(stress), hidden.stop - hidden.start)
        if self._from_start:
            slices["initial_stress"] = stress
        return self.layout.pack(**slices)

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        rows = state.T
        stress, after = self._step(dstrain.T, rows[self.layout["hidden"]])
        if not self._from_start:
            return stress.T, torch.cat([stress, *after]).T
        start = rows[self.layout["initial_stress"]]
        stress = start + stress
        return stress.T, torch.cat([stress, *after, start]).T

    def parameters_count(self) -> int:
        """See `MaterialCell.parameters_count`."""
        return sum(parameter.numel() for parameter in self.network.parameters())


class GruBaseline(NetworkBaseline[GruConfiguration, GruNetwork]):
    """The `gru`, trained on whole paths; see `NetworkBaseline`."""

    def check(self, records: xr.Dataset) -> None:
        """See `NetworkBaseline.check`; any records have strain and stress."""

    def fitted_to(self, configuration: GruConfiguration, records: xr.Dataset) -> GruConfiguration:
        """See `NetworkBaseline.fitted_to`: in the component order of the records."""
        order = component_order(tuple(map(str, records["component"].values)))
        return replace(configuration, order=order)

    def configuration_of(self, settings: dict[str, Any]) -> GruConfiguration:
        """See `NetworkBaseline.configuration_of`."""
        return GruConfiguration.of(settings)

    def network(self, configuration: GruConfiguration) -> GruNetwork:
        """See `NetworkBaseline.network`."""
        return GruNetwork(configuration)

    def scale(self, network: GruNetwork, training: xr.Dataset) -> None:
        """See `NetworkBaseline.scale`."""
        history = history_of(training)
        network.fit_scaling(history.strain, history.stress)

    def source(self, network: GruNetwork, split: xr.Dataset, device: torch.device) -> BatchSource:
        """Whole paths."""
        history = history_of(split)
        scale, mean, deviation = (
            buffer.cpu().double()
            for buffer in (network.increment_scale, network.stress_mean, network.stress_scale)
        )
        increments = (history.strain.diff(dim=1) / scale).to(device, torch.float32)
        target = network.configuration.target(history.stress)
        stress = ((target[:, 1:] - mean) / deviation).to(device, torch.float32)
        return ResidentBatches(
            lambda paths: (increments[paths], stress[paths]), len(increments), device
        )

    def cell(self, network: GruNetwork) -> GruCell:
        """See `NetworkBaseline.cell`."""
        return GruCell(network, self.name)


_RECIPE = Recipe(
    batch_size=50,
    learning_rate=1e-2,
    schedule="one-cycle",
    largest_gradient=1.0,
    epochs=300,
    patience=300,
)

BASELINE = GruBaseline(
    name="gru",
    title="GRU, two layers of 30 (Guan 2023, Sec 6.3)",
    settings={
        "reference": (GruConfiguration(), _RECIPE),
        # For starts under different pressures.
        "change": (GruConfiguration(output="change"), _RECIPE),
        # The thesis: all paths in one batch, a constant rate, 1e5 epochs.
        "paper": (GruConfiguration(), Recipe(batch_size=1000, epochs=100_000)),
    },
)
