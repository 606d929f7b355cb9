"""The jobs as modules, `python -m pipelines.NAME`: thin faces of `whsklearn.cli`, and the article's reproductions."""
