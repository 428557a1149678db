"""What a model costs: parameters, training time, and time for each stress update."""
