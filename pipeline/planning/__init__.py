"""What to cut with what: cutter choice, stepover, operations, feeds."""
