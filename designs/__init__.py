"""Parametric parts, one file each: a frozen parameter model and a pure function."""
