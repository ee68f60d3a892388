"""Observers of the extended braking stiffness."""
