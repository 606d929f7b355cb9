"""`python -m pipelines.simulate` is `whsklearn simulate`."""

from whsklearn.cli.simulate import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
