"""Side-slip of a car from its logs: estimated, compared with baselines, tuned."""
