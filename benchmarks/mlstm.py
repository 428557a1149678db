"""mLSTM against `torch.nn.LSTM`: CPU time of forward + backward, as ratios within one run.

The mLSTM's only change is where the hidden state starts, so it should cost what the fused LSTM
costs. Rivals: `nn.LSTM` alone; the `lstm` baseline, which has the same read-out; and the mLSTM
run step by step, as a naive implementation would.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable

import torch
from rich.console import Console
from rich.table import Table
from torch import Tensor

from granbench.baselines.recurrent_network import RecurrentConfiguration, RecurrentNetwork

SIZES = (64, 256, 1024)
"""Windows in a batch; 256 is the value of Table 2.4."""

STEPS = 20
REPEATS = 40
LIMIT = 1.2
"""Largest allowed `start_over_nn_lstm` at 256 windows."""


def rivals(windows: int) -> dict[str, Callable[[], Tensor]]:
    """One forward pass of each implementation on the same batch; each gives a scalar."""
    mlstm = RecurrentNetwork(RecurrentConfiguration(initial_layer=True))
    lstm = RecurrentNetwork(RecurrentConfiguration(initial_layer=False))
    inputs, start = torch.randn(windows, STEPS, 7), torch.randn(windows, 5)
    batch = inputs, start, torch.randn(windows, STEPS, 4)

    def without_read_out() -> Tensor:
        hidden = mlstm.first_hidden(start)[None]
        return mlstm.recurrent(inputs, (hidden, torch.zeros_like(hidden)))[0].square().mean()

    def step_by_step() -> Tensor:
        hidden = mlstm.first_hidden(start)
        carry, outputs = torch.zeros_like(hidden), []
        for step in inputs.unbind(dim=1):
            output, hidden, carry = mlstm.advance(step, hidden, carry)
            outputs.append(output)
        return (torch.stack(outputs, dim=1) - batch[2]).square().mean()

    return {
        "nn.LSTM": lambda: lstm.recurrent(inputs)[0].square().mean(),
        "mlstm, no read-out": without_read_out,
        "lstm": lambda: lstm.loss(batch),
        "mlstm": lambda: mlstm.loss(batch),
        "mlstm, step by step": step_by_step,
    }


def measure(windows: int) -> dict[str, float]:
    """CPU milliseconds of forward + backward for each, as medians of interleaved repeats."""
    passes = rivals(windows)
    times: dict[str, list[float]] = {name: [] for name in passes}
    for repeat in range(-5, REPEATS):
        for name, forward in passes.items():
            begin = time.process_time()
            forward().backward()
            if repeat >= 0:
                times[name].append(1e3 * (time.process_time() - begin))
    return {name: statistics.median(values) for name, values in times.items()}


def results() -> list[dict[str, object]]:
    """Times and ratios at every size."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    rows: list[dict[str, object]] = []
    for windows in SIZES:
        milliseconds = measure(windows)
        rows.append(
            {
                "windows": windows,
                "steps": STEPS,
                "cpu_milliseconds": milliseconds,
                "start_over_nn_lstm": milliseconds["mlstm, no read-out"] / milliseconds["nn.LSTM"],
                "mlstm_over_nn_lstm": milliseconds["mlstm"] / milliseconds["nn.LSTM"],
                "mlstm_over_lstm": milliseconds["mlstm"] / milliseconds["lstm"],
                "limit": LIMIT,
            }
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    rows = results()
    if arguments.json:
        print(json.dumps({"benchmark": "mlstm", "results": rows}, indent=2))
        return
    names = list(rows[0]["cpu_milliseconds"])
    ratio_names = [name for name in rows[0] if "_over_" in name]
    columns = [name.replace("_", " ") for name in ratio_names]
    table = Table("windows", *names, *columns, title="CPU ms, one core")
    for row in rows:
        times = [f"{row['cpu_milliseconds'][name]:.2f}" for name in names]
        ratios = [f"{row[name]:.2f}" for name in ratio_names]
        table.add_row(str(row["windows"]), *times, *ratios)
    Console().print(table)


if __name__ == "__main__":
    main()
