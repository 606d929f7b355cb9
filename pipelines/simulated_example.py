"""Identify the article's simulated example: `python -m pipelines.simulated_example`, part of `whsklearn demo`."""

from whsklearn.cli.simulated_example import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
