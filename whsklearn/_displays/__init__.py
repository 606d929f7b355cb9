"""One file a display; `whsklearn.plot` is their public face."""
