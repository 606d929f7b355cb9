"""One row at a time: the recursions of the textbooks.

`covariance` stores P as U D U', because P itself loses its symmetry and then its definiteness within 1e7 rows.  Every
recursion here is a sequence of its rank-one updates.  An innovation of length p takes p of them (block inversion
lemma), so no p by p matrix is ever inverted.  `least_squares` runs on given rows; `subinnovations` runs on the exact
gradient of `predictor`; `pseudolinear` is the published method, on the regressors of its auxiliary model.

State in, state out: a kernel takes arrays, changes them in place and allocates nothing, because a row takes a
microsecond and an allocation a tenth of one.
"""
