"""`mlstm`: the LSTM whose first hidden state is made of stress, void ratio and grading.

The `reference` settings keep the layers of Table 2.4, but read the output as the change in each
step, and let a free run start afresh after every 20 steps, the length of a training window:
carried further, the hidden state is where it never was in training. `paper` is Table 2.4 to the
letter.
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
