"""Jobs, one file each: `python -m pipelines.NAME --help`."""
