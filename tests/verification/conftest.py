import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "simulation"))      # for known_programs
sys.path.insert(0, str(Path(__file__).parents[1] / "toolpaths"))       # for exact_parts, brute_depth
