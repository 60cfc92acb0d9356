"""Strategies: one file each with one Operation, found by standing here (every_strategy.py)."""
