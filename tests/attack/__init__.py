"""Attacks with thousands of random stops: what the tests sample, at large. Each prints what it finds."""
