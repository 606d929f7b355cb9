"""`python -m pipelines.stream` is `whsklearn stream`."""

from whsklearn.cli.stream import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
