"""Observer gains tuned and judged."""
