"""Screening of a vehicle's controllers after UN Regulation No. 13-H, Annex 6: a simulation after it, no certificate."""
