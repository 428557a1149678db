"""Datasets `gp-*`: drawn strain paths through classical models."""
