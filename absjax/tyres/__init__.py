"""Tyre curves, one file each."""
