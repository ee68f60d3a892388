"""Whole vehicles: the cars shipped here, controllers tuned on them, and what is studied of them."""
