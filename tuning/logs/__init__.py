"""Logs and cars: read, checked, in the units of the project."""
