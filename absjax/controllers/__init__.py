"""Anti-lock controllers, one file each."""
