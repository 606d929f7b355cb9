"""``python -m whsklearn``."""

from whsklearn.cli import main

if __name__ == "__main__":
    main(prog_name="whsklearn")
