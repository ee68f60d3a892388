"""The road's friction curve from a brake log."""
