"""Coolants that operations ask for, and how moves that were read say which are on."""

from typing import Literal

Coolant = Literal["off", "air", "mist", "flood", "high_pressure"]
MIST, FLOOD, AIR, HIGH_PRESSURE = 1, 2, 4, 8        # several may be on at once
BITS = {"off": 0, "air": AIR, "mist": MIST, "flood": FLOOD, "high_pressure": HIGH_PRESSURE}
