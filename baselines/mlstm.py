"""`mlstm`: the LSTM with a first hidden state computed from stress, void ratio and grading.

The `reference` settings keep the layers of Table 2.4, but the output is the change in each step,
and a free run restarts after every 20 steps, the length of a training window, because the hidden
state would otherwise leave the range of training. `paper` is exactly Table 2.4.
"""

from granbench.baselines.recurrent_baseline import REFERENCE_RECIPE, RecurrentBaseline
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training import Recipe

BASELINE = RecurrentBaseline(
    name="mlstm",
    title="mLSTM (Guan 2023, Sec 2.2.2)",
    settings={
        "reference": (
            RecurrentConfiguration(initial_layer=True, output="increment", restart_every=20),
            REFERENCE_RECIPE,
        ),
        "paper": (RecurrentConfiguration(initial_layer=True), Recipe()),
    },
)
