"""The gap workflow of records of a Wiener-Hammerstein system: input and output alone."""
