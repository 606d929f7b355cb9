"""The default for a stream: the last samples stay in memory and are re-run while new ones arrive.

Why a memory: a recursion linearises every row once, at parameters that may be poor when the row arrives.  If the law
has a sign, the estimate never recovers from that.  Re-running the samples at the current parameters costs a bounded
number of passes over the memory per row, and ends in the minimum that a batch fit finds (`benchmarks/accuracy.py`).

Mathematics, each a state in and a state out: `gauss_newton` (squared errors of the samples in memory, and one
model to their minimum), `starts` (where models begin), `refit` (which models continue),
`linearised` and `sign_posterior` (the posterior of the parameters, including the signs of dx that are in doubt).

Scheduling: only `schedule` decides when a re-run begins, how much of it each row may do, and when its result takes
over.  Work that takes longer than a row is a generator there, and nowhere else: it calls the mathematics piece by piece
and yields where the next row may interrupt it, and its result does not depend on where it was interrupted.
`multistart` combines both into a stream.
"""
