"""The network of Table 2.4: an LSTM, with (mLSTM) or without a layer for the initial state."""

from typing import Literal, Self

import torch
from pydantic import StrictBool, model_validator
from pydantic.dataclasses import dataclass
from torch import Tensor, nn

from granbench.baselines.configuration import SETTINGS, Count, NetworkConfiguration
from granbench.baselines.training.batches import Batch

INPUTS = slice(0, 7)
"""Grading index, three accumulated strains (Eq 2.2), three strain increments (Fig 2.9)."""

STATES = slice(7, 11)
"""Three principal stresses and the void ratio."""

WIDTH = 11
STATE_COUNT = 4
START_COUNT = 1 + STATE_COUNT
"""Grading index and state where a window starts."""


@dataclass(frozen=True, config=SETTINGS)
class RecurrentConfiguration(NetworkConfiguration):
    """Architecture of an `lstm` or `mlstm`; the defaults are those of Table 2.4.

    Parameters
    ----------
    initial_layer : whether a dense layer computes the first hidden state from the initial state
    window : predicted steps of a training window
    hidden : width of the hidden state
    initial_width : width of the dense layer from the initial state
    read_out_width : width of the dense layer from the hidden state
    output : output of the last layer: the state itself (`absolute`, the thesis), its change since
        the start of the window (`change`), or its change in this step (`increment`); the last two
        need the initial state and so the initial layer
    restart_every : steps after which a free run computes a new hidden state from its own stress
        and void ratio, as at the start of a training window; None to keep the hidden state
    """

    initial_layer: StrictBool
    window: Count = 20
    hidden: Count = 50
    initial_width: Count = 40
    read_out_width: Count = 20
    output: Literal["absolute", "change", "increment"] = "absolute"
    restart_every: Count | None = None

    @model_validator(mode="after")
    def _check_start(self) -> Self:
        if not self.initial_layer and (self.output != "absolute" or self.restart_every):
            raise ValueError(
                "initial_layer=False: the start is unknown, so only output='absolute' without "
                "restart_every is possible"
            )
        return self

    def sizes(self) -> dict[str, int]:
        """See `NetworkConfiguration.sizes`."""
        widths = {"hidden": self.hidden, "read_out_width": self.read_out_width}
        return widths | ({"initial_width": self.initial_width} if self.initial_layer else {})

    @property
    def change_lag(self) -> int:
        """Steps over which changes are measured that scale the output."""
        return 1 if self.output == "increment" else (self.window + 1) // 2


class Scaling(nn.Module):
    """Means and standard deviations of a table's columns over the training split.

    They are buffers of the network, so that they are saved with its weights.
    """

    mean: Tensor
    scale: Tensor
    change_scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(WIDTH))
        self.register_buffer("scale", torch.ones(WIDTH))
        self.register_buffer("change_scale", torch.ones(STATE_COUNT))

    def set(self, mean: Tensor, scale: Tensor, change: Tensor) -> None:
        """Set means and standard deviations in place.

        Parameters
        ----------
        mean, scale : (`WIDTH`,), in the columns' units
        change : (`STATE_COUNT`,), typical change of the state, in its units
        """
        # A constant column, such as the I_G of a single grading, is only centred.
        scale = torch.where(scale > 0.0, scale, 1.0)
        self.mean.copy_(mean)
        self.scale.copy_(scale)
        self.change_scale.copy_(change / scale[STATES])

    def on_cpu(self) -> "Scaling":
        """A copy on the CPU."""
        copy = Scaling()
        copy.load_state_dict(self.state_dict())
        return copy

    def standardise(self, table: Tensor) -> Tensor:
        """Standardised table (..., `WIDTH`), in the type of the network."""
        return ((table - self.mean.to(table.dtype)) / self.scale.to(table.dtype)).to(
            self.mean.dtype
        )

    def inputs(self, raw: Tensor) -> Tensor:
        """Standardised inputs of raw ones (..., 7)."""
        return (raw - self.mean[INPUTS]) / self.scale[INPUTS]

    def states(self, raw: Tensor) -> Tensor:
        """Standardised states of raw ones (..., 4)."""
        return (raw - self.mean[STATES]) / self.scale[STATES]

    def raw_states(self, standardised: Tensor) -> Tensor:
        """Inverse of `states`."""
        return standardised * self.scale[STATES] + self.mean[STATES]


class RecurrentNetwork(nn.Module):
    """LSTM with a read-out of two layers and, for the mLSTM, a layer for the initial state.

    Inputs and outputs are standardised by its `scaling`.

    References
    ----------
    Guan (2023), Sec 2.2.2, Fig 2.9, Table 2.4; Eq 2.16 is the LSTM, Eq 2.20 the initial layer.
    The cell state starts at zero in both: the thesis gives only the initial hidden state.
    """

    def __init__(self, configuration: RecurrentConfiguration) -> None:
        super().__init__()
        self.configuration = configuration
        self.scaling = Scaling()
        width = configuration.hidden
        self.initial = nn.Sequential()
        if configuration.initial_layer:
            self.initial = nn.Sequential(
                nn.Linear(START_COUNT, configuration.initial_width),
                nn.ReLU(),
                nn.Linear(configuration.initial_width, width),
            )
        self.recurrent = nn.LSTM(INPUTS.stop, width, batch_first=True)
        self.read_out = nn.Sequential(
            nn.Linear(width, configuration.read_out_width),
            nn.ReLU(),
            nn.Linear(configuration.read_out_width, STATE_COUNT),
        )

    def first_hidden(self, start: Tensor) -> Tensor:
        """Hidden state (point, hidden) of an initial state (point, 5); zero for the LSTM."""
        if self.configuration.initial_layer:
            return self.initial(start)
        return start.new_zeros(len(start), self.configuration.hidden)

    def forward(self, inputs: Tensor, start: Tensor) -> Tensor:
        """States along windows.

        Parameters
        ----------
        inputs : (window, step, 7)
        start : (window, 5), grading index and state at the window's start

        Returns
        -------
        (window, step, 4)
        """
        hidden = self.first_hidden(start)[None]
        series, _ = self.recurrent(inputs, (hidden, torch.zeros_like(hidden)))
        output = self.read_out(series)
        if self.configuration.output == "absolute":
            return output
        change = output * self.scaling.change_scale
        if self.configuration.output == "increment":
            change = change.cumsum(dim=1)
        return start[:, None, 1:] + change

    def advance(
        self, inputs: Tensor, hidden: Tensor, carry: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One step with the same weights.

        Parameters
        ----------
        inputs : (point, 7)
        hidden, carry : (point, hidden)

        Returns
        -------
        output of the last layer (point, 4); hidden and carry after the step
        """
        weights = self.recurrent.all_weights[0]
        hidden, carry = torch.lstm_cell(inputs, (hidden, carry), *weights)
        return self.read_out(hidden), hidden, carry

    def loss(self, batch: Batch) -> Tensor:
        """Mean squared error of standardised stress and void ratio over all steps."""
        inputs, start, targets = batch
        return (self(inputs, start) - targets).square().mean()

    def parameters_count(self) -> int:
        """Number of trainable parameters."""
        return sum(parameter.numel() for parameter in self.parameters())
