"""`python -m pipelines.export` is `whsklearn export`."""

from whsklearn.cli.export import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
