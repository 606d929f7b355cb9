"""One row at a time: what a textbook calls a recursion.

`covariance` holds P as U D U', because P itself loses its symmetry and then its sign within 1e7 rows; every recursion
here is a sequence of its rank-one updates, and an innovation of length p is p of them (the block inversion lemma), so
no p by p matrix is ever inverted.  `least_squares` runs on rows that somebody else made; `subinnovations` runs on the
exact gradient of `predictor`; `pseudolinear` is the published method, on the regressors of `auxiliary_model`.

State in, state out: a kernel gets arrays, changes them in place and allocates nothing, since a row takes a microsecond
and an allocation takes a tenth of one.
"""
