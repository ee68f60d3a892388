"""Anti-lock controllers tuned, certified and judged."""
