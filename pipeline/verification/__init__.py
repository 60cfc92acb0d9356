"""The verdict: simulated stock against the designed part, by two verifiers."""
