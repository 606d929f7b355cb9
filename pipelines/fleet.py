"""`python -m pipelines.fleet` is `whsklearn fleet`."""

from whsklearn.cli.fleet import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
