"""The stock that the posted program leaves: swept cutters answered by query."""
