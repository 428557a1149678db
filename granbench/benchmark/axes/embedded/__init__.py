"""Whole finite-element analyses with the model at every Gauss point."""
