"""`python -m pipelines.close_gap` is `whsklearn gap`."""

from whsklearn.cli.gap import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
