"""A recurrent network as a material cell."""

import torch
from torch import Tensor

from granbench.baselines.recurrent_network import STATES, RecurrentNetwork
from granbench.cells.contract import Conditions, History, MaterialCell, StateLayout
from granbench.data.adapters import accumulated_strain
from granbench.errors import ModelError


class RecurrentCell(MaterialCell):
    """The LSTM or mLSTM of Table 2.4 as a cell.

    Its state holds its last output (stress in Pa, void ratio), the grading index, the chi of
    Eq 2.2, and the hidden state of the LSTM. If its output is a change since the start, the start
    is kept as `origin`; if it restarts, the steps since then as `age`.

    After a true record, the mLSTM restarts from the last true stress and void ratio, like every
    training window. The LSTM cannot: its hidden state is computed along the strain of the record.

    Parameters
    ----------
    network : trained; it is put into evaluation mode
    name : shown on the leaderboard
    """

    order = "principal"
    internals = ("void_ratio",)

    def __init__(self, network: RecurrentNetwork, name: str) -> None:
        self.network = network.eval().requires_grad_(False)
        self.name = name
        self.dtype = network.scaling.mean.dtype
        self.configuration = network.configuration
        widths = {
            "stress": 3,
            "void_ratio": 1,
            "accumulated_strain": 3,
            "hidden": self.configuration.hidden,
            "carry": self.configuration.hidden,
            "grading_index": 1,
        }
        if self.configuration.output == "change":
            widths["origin"] = 4
        if self.configuration.restart_every is not None:
            widths["age"] = 1
        self.layout = StateLayout.of(**widths)

    def initial_state(self, conditions: Conditions) -> Tensor:
        """See `MaterialCell.initial_state`; needs the void ratio and the grading index."""
        return self._start(
            stress=conditions.stress.to(self.dtype),
            void_ratio=conditions.require("initial_void_ratio").to(self.dtype)[:, None],
            accumulated_strain=conditions.past_strain().to(self.dtype),
            grading_index=conditions.require("grading_index").to(self.dtype)[:, None],
        )

    def _start(
        self, stress: Tensor, void_ratio: Tensor, accumulated_strain: Tensor, grading_index: Tensor
    ) -> Tensor:
        known = torch.cat([stress, void_ratio], dim=-1)
        hidden = self._first_hidden(known, grading_index)
        parts = {
            "stress": stress,
            "void_ratio": void_ratio,
            "accumulated_strain": accumulated_strain,
            "hidden": hidden,
            "carry": torch.zeros_like(hidden),
            "grading_index": grading_index,
            "origin": known,
            "age": torch.zeros_like(void_ratio),
        }
        return self.layout.pack(**{name: parts[name] for name in self.layout.slices})

    def _first_hidden(self, known: Tensor, grading_index: Tensor) -> Tensor:
        scaling = self.network.scaling
        index = (grading_index - scaling.mean[0]) / scaling.scale[0]
        return self.network.first_hidden(torch.cat([index, scaling.states(known)], dim=-1))

    def step(self, dstrain: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaterialCell.step`."""
        parts = {name: state[:, part] for name, part in self.layout.slices.items()}
        if (interval := self.configuration.restart_every) is not None:
            parts |= self._restarted(parts, parts["age"] >= interval)
        scaling = self.network.scaling
        raw = torch.cat([parts["grading_index"], parts["accumulated_strain"], dstrain], dim=-1)
        output, hidden, carry = self.network.advance(
            scaling.inputs(raw), parts["hidden"].contiguous(), parts["carry"].contiguous()
        )
        if self.configuration.output == "absolute":
            known = scaling.raw_states(output)
        else:
            change = output * scaling.change_scale * scaling.scale[STATES]
            known = change + (
                parts["origin"]
                if self.configuration.output == "change"
                else torch.cat([parts["stress"], parts["void_ratio"]], dim=-1)
            )
        stress = known[:, :3]
        parts |= {
            "stress": stress,
            "void_ratio": known[:, 3:],
            "accumulated_strain": parts["accumulated_strain"] + dstrain.abs(),
            "hidden": hidden,
            "carry": carry,
        }
        if "age" in parts:
            parts["age"] = parts["age"] + 1.0
        return stress, self.layout.pack(**parts)

    def _restarted(self, parts: dict[str, Tensor], due: Tensor) -> dict[str, Tensor]:
        """The changed parts of the state where a free run restarts from its own prediction."""
        known = torch.cat([parts["stress"], parts["void_ratio"]], dim=-1)
        fresh = {
            "hidden": self._first_hidden(known, parts["grading_index"]),
            "carry": torch.zeros_like(parts["carry"]),
            "age": torch.zeros_like(parts["age"]),
        }
        if "origin" in parts:
            fresh["origin"] = known
        return {name: torch.where(due, new, parts[name]) for name, new in fresh.items()}

    def condition(self, history: History) -> Tensor:
        """See `MaterialCell.condition` and the class."""
        if not self.configuration.initial_layer:
            return super().condition(history)
        return self._start(**{name: part[:, -1] for name, part in self._truth(history).items()})

    def condition_each(self, history: History) -> Tensor:
        """See `MaterialCell.condition_each`: one evaluation for all steps of the mLSTM."""
        if not self.configuration.initial_layer:
            return super().condition_each(history)
        points, steps = history.strain.shape[:2]
        flat = {name: part.flatten(0, 1) for name, part in self._truth(history).items()}
        return self._start(**flat).reshape(points, steps, self.layout.size)

    def _truth(self, history: History) -> dict[str, Tensor]:
        """The start of the mLSTM at every step of a record, each (point, step, ...)."""
        if "void_ratio" not in history.internals:
            raise ModelError(
                f"{self.name!r} starts from the true void ratio, but the record has none; use a "
                "dataset with the variable 'void_ratio'"
            )
        conditions = history.conditions
        past = conditions.past_strain()[:, None] + accumulated_strain(history.strain)
        index = conditions.require("grading_index")[:, None, None]
        truth = {
            "stress": history.stress,
            "void_ratio": history.internals["void_ratio"][..., None],
            "accumulated_strain": past,
            "grading_index": index.expand(-1, history.strain.shape[1], 1),
        }
        return {name: part.to(self.dtype) for name, part in truth.items()}

    def parameters_count(self) -> int:
        """See `MaterialCell.parameters_count`."""
        return self.network.parameters_count()
