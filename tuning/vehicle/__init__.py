"""Whole vehicles under anti-lock braking: studies and checks."""
