"""The axes of the benchmark: how each predicts and how it is scored, one folder an axis."""
