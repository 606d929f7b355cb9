"""Find the model that a log asks for: `python -m pipelines.identify`, the same as `whsklearn identify`."""

from whsklearn.cli.identify import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
