"""Controllers and machines: one file a controller, one TOML a machine, the reader."""
