"""What every task shares: problems and their fit, configurations, files, figures, reports."""
