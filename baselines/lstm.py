"""`lstm`: the long short-term memory network without initial stress and void ratio as input."""

from granbench.baselines.recurrent_baseline import REFERENCE_RECIPE, RecurrentBaseline
from granbench.baselines.recurrent_network import RecurrentConfiguration
from granbench.baselines.training import Recipe

ARCHITECTURE = RecurrentConfiguration(initial_layer=False)

BASELINE = RecurrentBaseline(
    name="lstm",
    title="LSTM (Guan 2023, Sec 2.2.1)",
    settings={
        "reference": (ARCHITECTURE, REFERENCE_RECIPE),
        "paper": (ARCHITECTURE, Recipe()),
    },
)
