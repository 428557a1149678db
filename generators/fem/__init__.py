"""Gauss-point histories of finite-element analyses: `fem-ime` and `fem-csuh`."""
