"""Write a log with a hidden effect: `python -m pipelines.hidden_effect`, part of `whsklearn demo`."""

from whsklearn.cli.demo import hidden_effect as main

__all__ = ["main"]

if __name__ == "__main__":
    main()
