"""`mlstm`: the LSTM whose first hidden state is made of stress, void ratio and grading."""

from granbench.baselines.recurrent_baseline import RecurrentBaseline
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training import Recipe

BASELINE = RecurrentBaseline(
    name="mlstm",
    title="mLSTM (Guan 2023, Sec 2.2.2)",
    settings={
        "reference": (
            RecurrentConfiguration(initial_layer=True, output="increment"),
            Recipe(schedule="cosine", epochs=400, patience=400),
        ),
        "paper": (RecurrentConfiguration(initial_layer=True), Recipe()),
    },
)
