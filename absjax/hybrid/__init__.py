"""Hybrid systems and the engine that rolls them out, differentiable through every switching."""
