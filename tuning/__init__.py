"""What is done with the models: logs in, parameters and reports out; command line."""
