"""`python -m pipelines.ui` is `whsklearn ui`."""

from whsklearn.cli.ui import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
