"""Makers of logs with a hidden effect, written from the equations and from nothing of the library.

The finder under test integrates, filters and steps in its own way; these makers share none
of it: 20 kHz explicit steps of fourth order, stiction after Karnopp, other controllers, rates
and parameters.  What the finder gets is a CSV.
"""
