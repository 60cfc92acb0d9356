"""Answers of others: programs, books, standards."""
