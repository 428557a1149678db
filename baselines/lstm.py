"""`lstm`: the classical LSTM, which starts blank and is not told stress or void ratio."""

from granbench.baselines.recurrent_baseline import RecurrentBaseline
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training import Recipe

ARCHITECTURE = RecurrentConfiguration(initial_layer=False)

BASELINE = RecurrentBaseline(
    name="lstm",
    title="LSTM (Guan 2023, Sec 2.2.1)",
    settings={
        "reference": (ARCHITECTURE, Recipe(schedule="cosine", epochs=400, patience=100)),
        "paper": (ARCHITECTURE, Recipe()),
    },
)
