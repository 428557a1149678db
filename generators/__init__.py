"""Generators of stress-strain datasets, all run by one resumable campaign executor."""
