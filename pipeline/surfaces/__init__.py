"""Exact surfaces of the B-rep: faces, curvature, sections."""
