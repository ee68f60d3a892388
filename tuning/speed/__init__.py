"""Estimators of the vehicle's speed tuned on simulated anti-lock stops, and compared."""
