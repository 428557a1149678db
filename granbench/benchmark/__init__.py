"""The benchmark: predictions of a model along every axis, and their scores."""
