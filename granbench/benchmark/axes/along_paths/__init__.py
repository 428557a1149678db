"""Predictions along recorded paths, compared with the records."""
