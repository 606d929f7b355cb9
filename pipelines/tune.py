"""`python -m pipelines.tune` is `whsklearn tune`."""

from whsklearn.cli.tune import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
