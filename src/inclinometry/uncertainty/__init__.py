"""Covariance through a model, components kept by name, coverage factors, Monte-Carlo check (GUM, GUM-S1)."""
