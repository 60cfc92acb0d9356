"""Cutter contact, offset, gouge-free tips, links: the geometry of the passes."""
