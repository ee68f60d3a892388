"""What a control unit measures instead of the truth."""
